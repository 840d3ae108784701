// Open a picture at full size, which small screens need.
document.addEventListener("DOMContentLoaded", () => {
  for (const picture of document.querySelectorAll("img.sphx-glr-single-img, img.sphx-glr-multi-img, article section > p > img, article section > img")) {
    const link = document.createElement("a");
    link.href = picture.src;
    link.title = "Full size";
    picture.replaceWith(link);
    link.append(picture);
  }
});
