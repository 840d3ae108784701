// Pictures on canvases: fields in colours, and points about a line.

const LIGHT = { ink: "#22302a", faint: "#66736c", rule: "#dfe2da", point: "#2f6f4f", line: "#b4531f", mark: "#12211a", halo: "#ffffff" };
const DARK = { ink: "#e3e9e4", faint: "#8a978f", rule: "#2e3833", point: "#8fcfa5", line: "#f0a067", mark: "#ffffff", halo: "#101512" };

let printing = false;
const dark = window.matchMedia("(prefers-color-scheme: dark)");
const inks = () => (dark.matches && !printing ? DARK : LIGHT);

// Colours of 256 levels between stops.
function ramp(hexes) {
  const stops = hexes.map((hex) => [1, 3, 5].map((at) => parseInt(hex.slice(at, at + 2), 16)));
  return Array.from({ length: 256 }, (_, k) => {
    const place = (k / 255) * (stops.length - 1);
    const low = Math.min(Math.floor(place), stops.length - 2);
    return stops[low].map((value, c) => value + (place - low) * (stops[low + 1][c] - value));
  });
}

// A canvas as sharp as the screen, and its size on the page; its height there follows from its proportions.
function fitted(canvas, aspect) {
  const width = Math.max(canvas.clientWidth, 1);
  const height = Math.round(width * aspect);
  const scale = Math.max(window.devicePixelRatio || 1, printing ? 2 : 1);
  canvas.width = Math.round(width * scale);
  canvas.height = Math.round(height * scale);
  const pen = canvas.getContext("2d");
  pen.setTransform(canvas.width / width, 0, 0, canvas.height / height, 0, 0);
  return { pen, width, height };
}

// A field in colours over the whole canvas; `extent` is what of the ground it covers, in shares of the scene.
function drawField(canvas, field, [low, high], colours, aspect, extent = [1, 1]) {
  const { pen, width, height } = fitted(canvas, aspect);
  const small = new OffscreenCanvas(field.columns, field.rows);
  const picture = new ImageData(field.columns, field.rows);
  field.values.forEach((value, k) => {
    if (!Number.isFinite(value)) return;
    const level = Math.round(255 * Math.min(Math.max((value - low) / (high - low), 0), 1));
    picture.data.set([...colours[level], 255], 4 * k);
  });
  small.getContext("2d").putImageData(picture, 0, 0);
  pen.imageSmoothingEnabled = false;
  pen.drawImage(small, 0, 0, width * extent[0], height * extent[1]);
  return { pen, width, height };
}

function outline(pen, x, y, width, height, dashed) {
  const { mark, halo } = LIGHT;
  for (const [colour, wide] of [[halo, 3.4], [mark, 1.6]]) {
    pen.setLineDash(dashed ? [3, 2.4] : []);
    pen.strokeStyle = colour;
    pen.lineWidth = wide;
    pen.strokeRect(x, y, width, height);
  }
  pen.setLineDash([]);
}

function multiples(step, low, high) {
  const found = [];
  for (let k = Math.ceil(low / step); k * step <= high + 1e-9; k += 1) found.push(k * step);
  return found;
}

// Round numbers between two: about `count` of them, and three at least, without which no scale can be read.
function ticks(low, high, count) {
  const rough = (high - low) / count;
  const size = 10 ** Math.floor(Math.log10(rough));
  const steps = [1, 2, 5, 10].map((each) => each * size);
  let at = steps.findIndex((each) => each >= rough);
  while (at > 0 && multiples(steps[at], low, high).length < 3) at -= 1;
  return { found: multiples(steps[at], low, high), digits: Math.max(0, -Math.floor(Math.log10(steps[at]) + 1e-9)) };
}

// Points of NDVI and truth with their line, that of the start, and the pixel that is marked.
function drawScatter(canvas, { x, y, line, first, marked, ranges, names }) {
  const { pen, width, height } = fitted(canvas, window.innerWidth <= 760 && !printing ? 0.64 : 0.86);
  const ink = inks();
  const [left, right, top, bottom] = [44, width - 10, 10, height - 38];
  const [[x0, x1], [y0, y1]] = ranges.map(([low, high]) => [low - 0.04 * (high - low), high + 0.04 * (high - low)]);
  const across = (value) => left + ((value - x0) / (x1 - x0)) * (right - left);
  const up = (value) => bottom - ((value - y0) / (y1 - y0)) * (bottom - top);
  pen.font = "12px system-ui, sans-serif";
  pen.lineWidth = 1;
  pen.fillStyle = ink.faint;
  pen.strokeStyle = ink.rule;
  pen.textAlign = "center";
  const along = ticks(x0, x1, width < 300 ? 3 : 5);
  for (const value of along.found) {
    pen.beginPath(); pen.moveTo(across(value), top); pen.lineTo(across(value), bottom); pen.stroke();
    pen.fillText(fixed(value, along.digits), across(value), bottom + 16);
  }
  pen.textAlign = "right";
  const upward = ticks(y0, y1, 5);
  for (const value of upward.found) {
    pen.beginPath(); pen.moveTo(left, up(value)); pen.lineTo(right, up(value)); pen.stroke();
    pen.fillText(fixed(value, upward.digits), left - 6, up(value) + 4);
  }
  pen.fillStyle = ink.ink;
  pen.textAlign = "center";
  pen.fillText(names[0], (left + right) / 2, bottom + 33);
  pen.save();
  pen.translate(12, (top + bottom) / 2);
  pen.rotate(-Math.PI / 2);
  pen.fillText(names[1], 0, 0);
  pen.restore();
  pen.save();
  pen.beginPath(); pen.rect(left, top, right - left, bottom - top); pen.clip();
  const side = x.length > 3000 ? 1.7 : x.length > 600 ? 2.4 : 3.6;
  pen.fillStyle = ink.point;
  pen.globalAlpha = Math.min(0.85, Math.max(0.22, 14 / Math.sqrt(x.length)));
  for (let k = 0; k < x.length; k += 1) {
    if (Number.isFinite(x[k]) && Number.isFinite(y[k])) pen.fillRect(across(x[k]) - side / 2, up(y[k]) - side / 2, side, side);
  }
  pen.globalAlpha = 1;
  const stroke = ({ slope, intercept }, colour, wide, dash) => {
    if (!Number.isFinite(slope)) return;
    pen.strokeStyle = colour; pen.lineWidth = wide; pen.setLineDash(dash);
    pen.beginPath();
    pen.moveTo(across(x0), up(intercept + slope * x0));
    pen.lineTo(across(x1), up(intercept + slope * x1));
    pen.stroke();
    pen.setLineDash([]);
  };
  if (first) stroke(first, ink.faint, 1.5, [5, 4]);
  stroke(line, ink.line, 2.4, []);
  if (marked !== null && Number.isFinite(x[marked]) && Number.isFinite(y[marked])) {
    for (const [colour, wide] of [[ink.halo, 4], [ink.ink, 2]]) {
      pen.strokeStyle = colour; pen.lineWidth = wide;
      pen.beginPath(); pen.arc(across(x[marked]), up(y[marked]), 6, 0, 2 * Math.PI); pen.stroke();
    }
  }
  pen.restore();
}
