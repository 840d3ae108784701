// The page itself: sliders in, pictures and numbers out.

const $ = (id) => document.getElementById(id);
const LABELS = Object.fromEntries(Object.entries(data.layers).map(([key, { label }]) => [key, label]));
const COLOURS = Object.fromEntries(Object.entries(data.layers).map(([key, { stops }]) => [key, ramp(stops)]));
// Where bars begin, and the shares that they may end at.
const ZERO = 12;
const SCALES = [0.05, 0.1, 0.25, 0.5, 1];
const START = { ...Object.fromEntries(data.sliders.map(({ key, start }) => [key, start])), variable: 0, view: "ndvi" };

function main(arrays) {
  let state = { ...START, ...settingInAddress() };
  let marked = null;
  let shown = pixelsOf(arrays, state);

  function draw() {
    const { rows, columns, cell } = data.scene;
    const aspect = rows / columns;
    const camera = data.instruments[state.instrument];
    const variable = data.variables[state.variable];
    const size = camera.pixel / cell;
    const extent = [(shown.columns * size) / columns, (shown.rows * size) / rows];
    const k = markedPixel();
    const [row, column] = [Math.floor(k / shown.columns), k % shown.columns];
    const scene = drawField($("scene"), { values: sceneOf(arrays, state), rows, columns }, data.ranges.scene, COLOURS.lai, aspect);
    const step = (scene.width * size) / columns;
    const [south, east] = data.offsets[state.registration];
    outline(scene.pen, column * step, row * step, step, step, false);
    if (south || east) outline(scene.pen, (column + east) * step, (row + south) * step, step, step, true);
    const field = { values: shown[state.view], rows: shown.rows, columns: shown.columns };
    const image = drawField($("image"), field, data.ranges[state.view], COLOURS[state.view], aspect, extent);
    outline(image.pen, column * step, row * step, step, step, false);
    drawScatter($("scatter"), {
      x: shown.ndvi, y: shown.truth, marked: k, line: lineOf(arrays, state),
      first: isStart() ? null : lineOf(arrays, { ...START, variable: state.variable }),
      ranges: [data.axes.ndvi, data.axes[variable]], names: [`${LABELS.ndvi} of the pixel`, `true ${data.layers[variable].axis} of the pixel`],
    });
    $("reading").textContent = `Pixel in row ${row + 1}, column ${column + 1}: NDVI ${fixed(shown.ndvi[k], 3)}, `
      + `true ${LABELS[variable]} ${fixed(shown.truth[k], 2)}`;
  }

  const isStart = () => KEYS.every((key) => state[key] === START[key]);
  const markedPixel = () => (marked !== null && marked < shown.size
    ? marked : Math.floor(shown.rows / 2) * shown.columns + Math.floor(shown.columns / 2));

  function say() {
    const variable = data.variables[state.variable];
    const camera = data.instruments[state.instrument];
    for (const { key, texts } of data.sliders) {
      const text = key === "registration" ? registration(texts[state[key]], camera) : texts[state[key]];
      $(key).value = state[key];
      $(key).setAttribute("aria-valuetext", text);
      $(`${key}-said`).textContent = text;
    }
    for (const input of document.querySelectorAll("input[type=radio]")) {
      input.checked = String(state[input.name]) === input.value;
    }
    const line = lineOf(arrays, state);
    const shares = sharesOf(arrays, state);
    const start = lineOf(arrays, { ...START, variable: state.variable });
    $("r2").textContent = fixed(line.r2, 3);
    $("slope").textContent = fixed(line.slope, 3);
    $("intercept").textContent = fixed(line.intercept, 3);
    $("n").textContent = fixed(line.n, 0);
    $("then").textContent = isStart() ? "" : `at the start ${fixed(start.r2, 3)}`;
    $("headline").replaceChildren(...headline(line, shares, variable));
    $("scene-about").textContent = data.sliders[0].texts[state.arp];
    $("image-about").textContent = `${camera.name}, pixels of ${camera.pixel} m, ${camera.bits} bits; ${LABELS[state.view]}`;
    $("scatter-about").textContent = `true ${LABELS[variable]} against NDVI, ${fixed(line.n, 0)} pixels`;
    $("explained").style.width = `${100 * Math.max(line.r2, 0)}%`;
    $("explained-said").textContent = `the line explains ${fixed(100 * line.r2, 1)} %`;
    $("left-said").textContent = `scatter ${fixed(100 * (1 - line.r2), 1)} %`;
    bars(shares);
    legend("scene", data.ranges.scene, data.layers.lai);
    legend("image", data.ranges[state.view], data.layers[state.view]);
    $("image").setAttribute("aria-label", `The image of ${camera.name}: ${shown.rows} by ${shown.columns} pixels. Arrow keys mark another pixel.`);
    $("scatter").setAttribute("aria-label", `${$("scatter-about").textContent}. R squared ${fixed(line.r2, 3)}, slope ${fixed(line.slope, 3)}.`);
    $("toml").textContent = tomlOf(state);
  }

  function registration(text, camera) {
    const [south, east] = data.offsets[state.registration];
    const metres = Math.hypot(south, east) * camera.pixel;
    return metres ? `${text}, ${Number(metres.toPrecision(3))} m` : text;
  }

  function headline(line, shares, variable) {
    const bold = (text) => Object.assign(document.createElement("b"), { textContent: text });
    if (!Number.isFinite(line.slope)) {
      return ["Every pixel has the ", bold("same NDVI"), `: the counts are too coarse for what varies here, and it tells nothing of ${LABELS[variable]}.`];
    }
    const largest = shares.indexOf(Math.max(...shares));
    return ["A line on NDVI tells ", bold(`${fixed(100 * line.r2, 0)} %`), ` of how ${LABELS[variable]} varies from pixel to pixel. The largest part of the rest is `,
      bold(data.stages[largest].name), `, ${fixed(100 * shares[largest], 1)} %.`];
  }

  // Bars of the budget grow from zero; a stage that makes the relation straighter goes to the left. [%]
  function bars(shares) {
    const needed = Math.max(...shares, (-Math.min(...shares) * (100 - ZERO)) / ZERO);
    const end = SCALES.find((scale) => scale >= needed) || 1;
    $("scale-end").textContent = `${fixed(100 * end, 0)} %`;
    shares.forEach((share, k) => {
      const length = ((100 - ZERO) * Math.abs(share)) / end;
      $(`stage${k}`).style.left = `${ZERO - (share < 0 ? length : 0)}%`;
      $(`stage${k}`).style.width = `${length}%`;
      $(`stage${k}`).classList.toggle("below", share < 0);
      $(`share${k}`).textContent = share === 0 ? "0" : fixed(100 * share, 1);
    });
  }

  function legend(name, [low, high], { stops, label }) {
    $(`${name}-bar`).style.background = `linear-gradient(90deg, ${stops.join(", ")})`;
    $(`${name}-low`).textContent = fixed(low, 2);
    $(`${name}-high`).textContent = fixed(high, 2);
    $(`${name}-of`).textContent = label;
  }

  // What the last move changed, and what it did not.
  function compare(past) {
    const changed = (...keys) => keys.some((key) => past.state[key] !== state[key]);
    const slider = data.sliders.find(({ key }) => past.state[key] !== state[key]);
    const named = (at) => (slider ? slider.marks[at[slider.key]]
      : changed("variable") ? LABELS[data.variables[at.variable]] : LABELS[at.view]);
    const title = slider ? slider.name : changed("variable") ? "Compared with" : "Image in";
    const variable = data.variables[state.variable];
    const other = Array.from(shown.counts).filter((count, k) => count !== past.shown.counts[k]).length;
    const line = lineOf(arrays, state);
    const image = changed("instrument") ? "another instrument's"
      : other ? `${fixed((100 * other) / shown.counts.length, 0)} % other numbers` : "the same";
    const truth = shown.size === past.shown.size && shown.truth.every((value, k) => Object.is(value, past.shown.truth[k]));
    chip("ground", changed("arp") ? "another" : "the same", !changed("arp"));
    chip("truth", truth ? "the same" : changed("instrument") ? "of other pixels" : "others", truth);
    chip("image", image, image === "the same");
    chip("line", line.r2 === past.line.r2 ? "the same" : `R² ${fixed(past.line.r2, 3)} → ${fixed(line.r2, 3)}`, line.r2 === past.line.r2);
    $("truth-name").textContent = `True ${LABELS[variable]}`;
    $("moved-what").textContent = `${title}: ${named(past.state)} → ${named(state)}`;
  }

  function chip(name, text, same) {
    $(`${name}-moved`).textContent = text;
    $(`${name}-moved`).parentElement.classList.toggle("same", same);
  }

  function move(change) {
    const before = { state, shown, line: lineOf(arrays, state) };
    state = { ...state, ...change };
    shown = pixelsOf(arrays, state);
    say();
    draw();
    compare(before);
    const said = [...KEYS, "variable", "view"].filter((key) => state[key] !== START[key]).map((key) => `${key}=${state[key]}`);
    history.replaceState(null, "", said.length ? `#${said.join("&")}` : "#");
  }

  for (const key of KEYS) $(key).addEventListener("input", (event) => move({ [key]: Number(event.target.value) }));
  for (const input of document.querySelectorAll("input[type=radio]")) {
    input.addEventListener("change", () => move({ [input.name]: input.name === "view" ? input.value : Number(input.value) }));
  }
  $("reset").addEventListener("click", () => { marked = null; move(START); });
  $("copy").addEventListener("click", () => copy($("toml").textContent));
  for (const name of ["scene", "image"]) $(name).addEventListener("pointermove", (event) => mark(event));
  for (const name of ["scene", "image"]) $(name).addEventListener("pointerdown", (event) => mark(event));
  $("image").addEventListener("keydown", (event) => {
    const steps = { ArrowLeft: [0, -1], ArrowRight: [0, 1], ArrowUp: [-1, 0], ArrowDown: [1, 0] }[event.key];
    if (!steps) return;
    event.preventDefault();
    const k = markedPixel();
    markAt(Math.floor(k / shown.columns) + steps[0], (k % shown.columns) + steps[1]);
  });

  function mark(event) {
    const box = event.target.getBoundingClientRect();
    const side = (data.instruments[state.instrument].pixel / data.scene.cell / data.scene.columns) * box.width;
    markAt(Math.floor((event.clientY - box.top) / side), Math.floor((event.clientX - box.left) / side));
  }

  function markAt(row, column) {
    if (row < 0 || column < 0 || row >= shown.rows || column >= shown.columns) return;
    marked = row * shown.columns + column;
    draw();
  }

  async function copy(text) {
    try {
      await navigator.clipboard.writeText(text);
      $("copied").textContent = "copied";
    } catch {
      window.getSelection().selectAllChildren($("toml"));
      $("copied").textContent = "selected: copy it with Ctrl-C";
    }
  }

  let width = 0;
  new ResizeObserver(() => {
    if (document.body.clientWidth !== width) { width = document.body.clientWidth; draw(); }
  }).observe(document.body);
  dark.addEventListener("change", draw);
  const paper = (on) => () => { printing = on; draw(); };
  window.addEventListener("beforeprint", paper(true));
  window.addEventListener("afterprint", paper(false));
  window.addEventListener("hashchange", () => move({ ...START, ...settingInAddress() }));
  say();
  draw();
  document.body.classList.add("ready");
  // For the console: the pixels of the setting that is shown.
  window.explorer = { pixels: () => ({ ...shown, state: { ...state } }), set: move };
}

// Settings that a link to the page names, such as #arp=2&registration=3.
function settingInAddress() {
  const found = {};
  for (const [key, text] of new URLSearchParams(location.hash.slice(1))) {
    const slider = data.sliders.find((each) => each.key === key);
    const count = slider ? slider.texts.length : key === "variable" ? data.variables.length : 0;
    if (/^\d+$/.test(text) && Number(text) < count) found[key] = Number(text);
    if (key === "view" && data.views.includes(text)) found.view = text;
  }
  return found;
}

if (typeof DecompressionStream === "undefined" || typeof OffscreenCanvas === "undefined") {
  $("headline").textContent = "This page needs a browser of 2023 or later.";
} else {
  unpacked($("bytes").textContent).then(main);
}
