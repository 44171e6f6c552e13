// Maps of errors that are computed from the pixels of the page: what a metric is the mean of, on one scale for all rows.

/**
 * @typedef {{ width: number, height: number, channels: Float64Array[] }} Values
 * @typedef {{ title: string, fits: (layer: Layer) => boolean, unit: (layer: Layer) => string,
 *   map: (p: Values, t: Values, layer: Layer, inside: Uint8Array) => Float64Array }} Measure
 * @typedef {{ high: number, drawn: Map<string, Drawn>, means: Map<string, number> }} Maps
 */

const RADIUS = 5;
const TAPS = Array.from({ length: 2 * RADIUS + 1 }, (_, tap) => Math.exp(-((tap - RADIUS) ** 2) / 4.5));
const TAPS_SUM = TAPS.reduce((sum, tap) => sum + tap);
/** Least truth that an error is relative to: below it is the error of the codes. */
const LEAST = 0.01;
/** Below this a value is the rounding of the arithmetic. */
const ROUNDING = 1e-12;
const ROUND = [1, 1.5, 2, 3, 4, 5, 6, 8, 10];

/** @param {Layer} layer */
const isLight = (layer) => ["light", "display"].includes(layer.truth.picture?.code ?? "") && layer.unit === "as displayed";
/** @param {Layer} layer */
const isShare = (layer) => layer.truth.picture?.code === "share";
/** @param {Layer} layer */
const isNumber = (layer) => layer.truth.picture?.code === "number";

/** Depth, in metres. @param {Layer} layer */
const isLength = (layer) => isNumber(layer) && layer.error_scale.unit === "m";

/** Error of a depth as the metrics take it: never more than the truth, which is that of an empty pixel. @param {number} p @param {number} t */
const lengthError = (p, t) => (Number.isNaN(p) ? t : Math.min(Math.abs(p - t), t));

/** A value of a computed map, with two significant digits at least. @param {number} value */
function mapNumber(value) {
  const size = Math.abs(value);
  if (Number.isNaN(value) || size >= 0.001) return shortNumber(value);
  return size < ROUNDING ? "0" : value.toExponential(1).replaceAll("-", "\u2212");
}

/** As the metrics of the layer compare it: light as a display shows it. @param {Values} values @param {boolean} shown @returns {Float64Array[]} */
const asCompared = ({ channels }, shown) => (shown ? channels.map((values) => values.map((value) => toDisplay(Math.max(value, 0)))) : channels);

/** Mean over channels. @param {Float64Array[]} p @param {Float64Array[]} t @param {(p: number, t: number) => number} rule */
const meanOf = (p, t, rule) => t[0].map((_, i) => t.reduce((sum, values, c) => sum + rule(p[c][i], values[i]), 0) / t.length);

/** Means in a Gaussian window along rows or columns; beyond the edge the picture is mirrored.
 * @param {Float64Array} values @param {number} width @param {number} height @param {boolean} down */
function smoothed(values, width, height, down) {
  const [count, step, lines, jump] = down ? [height, width, width, 1] : [width, 1, height, width];
  const found = new Float64Array(values.length);
  for (let line = 0; line < lines; line += 1) {
    for (let k = 0; k < count; k += 1) {
      let sum = 0;
      for (let tap = 0; tap < TAPS.length; tap += 1) {
        const m = k + tap - RADIUS;
        sum += TAPS[tap] * values[line * jump + (m < 0 ? -1 - m : m >= count ? 2 * count - 1 - m : m) * step];
      }
      found[line * jump + k * step] = sum / TAPS_SUM;
    }
  }
  return found;
}

/** Structural similarity, Wang et al. 2004: windows of 11 × 11 pixels, sigma 1.5, K = (0.01, 0.03), peak 1.
 * @param {Float64Array} p @param {Float64Array} t @param {number} width @param {number} height */
function similarity(p, t, width, height) {
  const mean = (/** @type {Float64Array} */ values) => smoothed(smoothed(values, width, height, false), width, height, true);
  const [mp, mt, pp, tt, pt] = [p, t, p.map((v) => v * v), t.map((v) => v * v), p.map((v, i) => v * t[i])].map(mean);
  return mp.map((m, i) => {
    const n = mt[i];
    return ((2 * m * n + 1e-4) * (2 * (pt[i] - m * n) + 9e-4)) / ((m * m + n * n + 1e-4) * (pp[i] - m * m + tt[i] - n * n + 9e-4));
  });
}

/** Pixels whose window lies inside; all that are inside where there is none. @param {Uint8Array} inside @param {number} width @param {number} height */
function interior(inside, width, height) {
  const whole = inside.map((_, i) => {
    const [x, y] = [i % width, Math.floor(i / width)];
    if (x < RADIUS || y < RADIUS || x >= width - RADIUS || y >= height - RADIUS) return 0;
    for (let dy = -RADIUS; dy <= RADIUS; dy += 1) for (let dx = -RADIUS; dx <= RADIUS; dx += 1) if (!inside[i + dy * width + dx]) return 0;
    return 1;
  });
  return whole.some(Boolean) ? whole : inside;
}

/** By the name that a link has. @type {Record<string, Measure>} */
const MEASURES = {
  squares: {
    title: "Squared error",
    fits: (layer) => isLight(layer) || isShare(layer) || isNumber(layer),
    unit: ({ error_scale: { unit } }) => (unit === "m" ? "m²" : `${unit}, squared`),
    map: (p, t, layer) => meanOf(asCompared(p, isLight(layer)), asCompared(t, isLight(layer)), (a, b) => (isLength(layer) ? lengthError(a, b) : a - b) ** 2),
  },
  ssim: {
    title: "1 − SSIM",
    fits: (layer) => (isLight(layer) || layer.layer === "base_color") && Math.min(layer.truth.picture?.width ?? 0, layer.truth.picture?.height ?? 0) > 2 * RADIUS,
    unit: () => "(1 − SSIM)",
    map: (p, t, _, inside) => {
      const true_ = asCompared(t, true);
      const outside = asCompared(p, true).map((values, c) => values.map((value, i) => (inside[i] ? value : true_[c][i])));
      const found = outside.map((values, c) => similarity(values, true_[c], t.width, t.height));
      const whole = interior(inside, t.width, t.height);
      return found[0].map((_, i) => (whole[i] ? 1 - found.reduce((sum, values) => sum + values[i], 0) / found.length : Number.NaN));
    },
  },
  relative: {
    title: "Relative error",
    fits: (layer) => isShare(layer) || isLength(layer),
    unit: () => "% of the truth",
    map: (p, t, layer) => meanOf(p.channels, t.channels, (a, b) => 100 * (isLength(layer) ? lengthError(a, b) / b : Math.abs(a - b) / Math.max(b, LEAST))),
  },
};

/** @param {Drawn} drawn @returns {Values} */
function valuesOf({ width, height, read }) {
  const channels = read(0, 0).map(() => new Float64Array(width * height));
  for (let i = 0; i < width * height; i += 1) read(i % width, Math.floor(i / width)).forEach((value, c) => { channels[c][i] = value; });
  return { width, height, channels };
}

/** First of some round numbers that is no less than the 98th percentile above zero. @param {Float64Array[]} maps */
function sharedScale(maps) {
  const seen = Float64Array.from(maps.flatMap((values) => [...values.filter((value) => value > 0 && Number.isFinite(value))])).sort();
  if (!seen.length) return 1;
  const [place, rest] = [Math.floor(0.98 * (seen.length - 1)), (0.98 * (seen.length - 1)) % 1];
  const high = seen[place] + rest * ((seen[place + 1] ?? seen[place]) - seen[place]);
  const power = 10 ** Math.floor(Math.log10(high));
  return Number(((ROUND.find((step) => step * power >= high * (1 - 1e-9)) ?? 10) * power).toPrecision(6));
}

/** A map as colours, whose values are read as they are. @param {Float64Array} values @param {number} width @param {number} height @param {number} high @returns {Drawn} */
function drawMap(values, width, height, high) {
  const colours = colourMap("error");
  const canvas = document.createElement("canvas");
  Object.assign(canvas, { width, height });
  const context = /** @type {CanvasRenderingContext2D} */ (canvas.getContext("2d"));
  const pixels = context.createImageData(width, height);
  values.forEach((value, i) => pixels.data.set([...(Number.isNaN(value) ? [128, 128, 128] : colours[Math.round(254 * Math.min(Math.max(value / high, 0), 1))]), 255], 4 * i));
  context.putImageData(pixels, 0, 0);
  return { width, height, read: (x, y) => [values[y * width + x]], draw: () => canvas };
}

/** Maps of all rows in all views of a layer. @param {View[]} views @param {string} title @param {Measure} measure @param {(picture: Picture) => Promise<Drawn>} decoded @returns {Promise<Maps>} */
async function computeMaps(views, title, measure, decoded) {
  /** @type {Map<string, { values: Float64Array, width: number, height: number }>} */
  const found = new Map();
  for (const [v, view] of views.entries()) {
    const layer = view.rows.find((row) => row.title === title);
    if (!layer?.truth.picture) continue;
    const truth = valuesOf(await decoded(layer.truth.picture));
    for (const [row, { picture }] of layer.predictions.entries()) {
      const judged = layer.errors[row]?.picture;
      if (!picture || !judged) continue;
      const [mask] = valuesOf(await decoded(judged)).channels;
      const inside = Uint8Array.from(mask, (value) => Number(!Number.isNaN(value)));
      const values = measure.map(valuesOf(await decoded(picture)), truth, layer, inside).map((value, i) => (inside[i] ? value : Number.NaN));
      found.set(`${v} ${row}`, { values, width: truth.width, height: truth.height });
      await new Promise((next) => { setTimeout(next); });  // the page stays alive meanwhile
    }
  }
  const high = sharedScale([...found.values()].map(({ values }) => values));
  const mean = (/** @type {Float64Array} */ values) => { const seen = values.filter(Number.isFinite); return seen.reduce((sum, value) => sum + value, 0) / seen.length; };
  return {
    high,
    drawn: new Map([...found].map(([key, { values, width, height }]) => [key, drawMap(values, width, height, high)])),
    means: new Map([...found].map(([key, { values }]) => [key, mean(values)])),
  };
}
