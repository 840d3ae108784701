// What the page holds, and what of it belongs to a setting of the sliders.

const data = JSON.parse(document.getElementById("data").textContent);
const KEYS = data.sliders.map((slider) => slider.key);

// Typed arrays of all that was packed, by name: values and shape.
async function unpacked(text) {
  const bytes = Uint8Array.from(atob(text.trim()), (letter) => letter.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  const buffer = await new Response(stream).arrayBuffer();
  const arrays = {};
  for (const [name, { kind, shape, start }] of Object.entries(data.places)) {
    const count = shape.reduce((product, size) => product * size, 1);
    arrays[name] = { shape, values: read(buffer, kind, start, count) };
  }
  return arrays;
}

function read(buffer, kind, start, count) {
  if (kind === "u1") return new Uint8Array(buffer, start, count);
  if (kind === "f4") return new Float32Array(buffer, start, count);
  if (kind === "f8") return new Float64Array(buffer, start, count);
  const bytes = new Uint8Array(buffer, start, 2 * count);
  return Uint16Array.from({ length: count }, (_, k) => bytes[k] + 256 * bytes[count + k]);
}

// The part of an array at the first of its indices.
function part({ shape, values }, ...indices) {
  const size = shape.slice(indices.length).reduce((product, each) => product * each, 1);
  let place = 0;
  indices.forEach((index, axis) => { place = place * shape[axis] + index; });
  return values.subarray(place * size, (place + 1) * size);
}

// Values of codes in equal steps, NaN where the code is 0.
function unstepped(codes, [low, step]) {
  return Float64Array.from(codes, (code) => (code ? low + (code - 1) * step : NaN));
}

function setting(state) {
  return KEYS.map((key) => state[key]);
}

function sceneOf(arrays, state) {
  return unstepped(part(arrays.scenes, state.arp), data.steps.scenes);
}

// Pixels of a setting: their numbers, reflectance, NDVI and truth, each by row and column.
function pixelsOf(arrays, state) {
  const { arp, haze, sza, instrument, registration } = state;
  const image = arrays[`image${instrument}`];
  const [rows, columns] = image.shape.slice(-2);
  const counts = part(image, arp, haze, sza, registration);
  const size = rows * columns;
  const muS = Math.cos((data.szas[sza] * Math.PI) / 180);
  const [red, nir] = [0, 1].map((band) => {
    const overhead = part(arrays[`reflectance${instrument}`], band);
    return Float64Array.from({ length: size }, (_, k) => overhead[counts[band * size + k]] / muS);
  });
  const ndvi = red.map((value, k) => (nir[k] - value) / (nir[k] + value));
  const truths = {
    lai: unstepped(part(arrays[`lai${instrument}`], arp), data.steps[`lai${instrument}`]),
    fpar: unstepped(part(arrays[`fpar${instrument}`], arp, sza), data.steps[`fpar${instrument}`]),
  };
  return { rows, columns, size, counts, red, nir, ndvi, truth: truths[data.variables[state.variable]] };
}

function lineOf(arrays, state) {
  const [slope, intercept, r2, n] = part(arrays.lines, ...setting(state), state.variable);
  return { slope, intercept, r2, n };
}

function sharesOf(arrays, state) {
  return Array.from(part(arrays.shares, ...setting(state), state.variable));
}

// A number as it is printed, with a true minus.
function fixed(value, digits) {
  if (!Number.isFinite(value)) return "–";
  const text = value.toFixed(digits);
  return (Number(text) === 0 ? text.replace("-", "") : text).replace("-", "−");
}

// TOML of the scenario of a setting.
function tomlOf(state) {
  const { tables, haze, arps, hazes } = data.keys;
  const said = structuredClone(tables);
  const put = (table, key, value) => { said[table] = { ...said[table], [key]: value }; };
  if (arps[state.arp] !== null) put("ground", "arp", arps[state.arp]);
  if (hazes[state.haze] !== null) put("atmosphere", haze, hazes[state.haze]);
  put("geometry", "sza", data.szas[state.sza]);
  said.sensor = { ...data.instruments[state.instrument].keys, offset: data.offsets[state.registration] };
  const lines = [];
  for (const [name, table] of Object.entries(said)) {
    const inside = name === "classes" ? Object.entries(table).map(([key, each]) => [`classes.${key}`, each]) : [[name, table]];
    for (const [place, keys] of inside) {
      lines.push(`[${place}]`, ...Object.entries(keys).filter(([, value]) => value !== null)
        .map(([key, value]) => `${key} = ${tomlValue(value)}`), "");
    }
  }
  return lines.join("\n").trimEnd() + "\n";
}

function tomlValue(value) {
  if (Array.isArray(value)) return `[${value.map(tomlValue).join(", ")}]`;
  if (value !== null && typeof value === "object") {
    return `{${Object.entries(value).map(([key, each]) => `${JSON.stringify(key)} = ${tomlValue(each)}`).join(", ")}}`;
  }
  return JSON.stringify(value);
}
