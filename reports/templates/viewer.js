// The bench for pictures: decode codes to values, draw them side by side, and read values under the pointer.

/**
 * @typedef {{ webp: string, width: number, height: number, alt: string, code: string, low: number, high: number }} Picture
 * @typedef {{ picture: Picture | null, missing: string, note: string }} Tile
 * @typedef {{ colours: string, low: string, high: string, unit: string }} Scale
 * @typedef {{ title: string, unit: string, layer: string, values: string, precision: string, truth: Tile, predictions: Tile[],
 *   errors: Tile[], noise_ratios: Tile[], error_scale: Scale, noise_scale: Scale, value_scale: Scale | null }} Layer
 * @typedef {{ name: string, rows: Layer[] }} View
 * @typedef {{ thumbnails: Picture[], views: View[] }} Gallery
 * @typedef {{ width: number, height: number, read: (x: number, y: number) => number[], draw: (stops: number) => HTMLCanvasElement }} Drawn
 * @typedef {{ label: string, canvas: HTMLCanvasElement, shown: () => (Drawn | undefined)[] }} Pane
 */

const KNEE = Number(document.body.dataset.knee);
const STEP = Number(document.body.dataset.step);
const LEVELS = Number(document.body.dataset.levels);
const NO_NUMBER = 65535;
const TRUTH = -1;
/** Letters of a title that a tab cuts off. */
const LONG = 32;
/** What the map of a unit shows. @type {Record<string, string>} */
const ERRORS = { degrees: "Angle", "display difference": "Error, largest channel", "linear difference": "Error, largest channel" };
const KEYS = "Keys: 0 truth, 1 to 9 rows, Space swaps, E error, M mode, arrows move the pixel that is read, plus and minus zoom";

/** Display value in [0, 1] of linear light, IEC 61966-2-1. @param {number} x */
const toDisplay = (x) => (x <= 0.0031308 ? 12.92 * x : 1.055 * Math.min(x, 1) ** (1 / 2.4) - 0.055);
/** @param {number} v */
const toLinear = (v) => (v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4);
const LINEAR = Float64Array.from({ length: 256 }, (_, code) => toLinear(code / 255));

/** Colours of a map, 255 of them. @param {string} name @returns {number[][]} */
function colourMap(name) {
  const text = document.getElementById("colour-maps")?.textContent ?? "{}";
  return JSON.parse(text)[name];
}

/** Bytes of a lossless picture. @param {string} webp @returns {Promise<{ bytes: Uint8ClampedArray, width: number, height: number }>} */
async function bytesOf(webp) {
  const data = Uint8Array.from(atob(webp), (letter) => letter.charCodeAt(0));
  const image = await createImageBitmap(new Blob([data], { type: "image/webp" }), { colorSpaceConversion: "none", premultiplyAlpha: "none" });
  const canvas = document.createElement("canvas");
  canvas.width = image.width;
  canvas.height = image.height;
  const context = canvas.getContext("2d", { willReadFrequently: true });
  if (!context) throw new Error("expected a canvas to draw on, got none");
  context.drawImage(image, 0, 0);
  return { bytes: context.getImageData(0, 0, canvas.width, canvas.height).data, width: image.width, height: image.height };
}

/** What pixels mean: read(i) gives the values of a pixel, paint(stops) a function from a pixel to its colour.
 * @param {Picture} picture @param {Uint8ClampedArray} bytes
 * @returns {{ read: (i: number) => number[], paint: (stops: number) => (i: number) => number[] }} */
function meaning(picture, bytes) {
  const rgb = (/** @type {number} */ i) => [bytes[4 * i], bytes[4 * i + 1], bytes[4 * i + 2]];
  const half = bytes.length / 2;
  const span = picture.high - picture.low;
  switch (picture.code) {
    case "light": {
      const code = (/** @type {number} */ i) => [0, 1, 2].map((c) => bytes[4 * i + c] * 256 + bytes[half + 4 * i + c]);
      return {
        read: (i) => code(i).map((c) => KNEE * Math.expm1(c * STEP)),
        paint: (stops) => {
          const gain = KNEE * 2 ** stops;
          const table = Uint8ClampedArray.from({ length: LEVELS }, (_, c) => Math.round(255 * toDisplay(gain * Math.expm1(c * STEP))));
          return (i) => code(i).map((c) => table[c]);
        },
      };
    }
    case "display":
      return {
        read: (i) => rgb(i).map((c) => LINEAR[c]),
        paint: (stops) => {
          const table = Uint8ClampedArray.from({ length: 256 }, (_, c) => Math.round(255 * toDisplay(LINEAR[c] * 2 ** stops)));
          return (i) => rgb(i).map((c) => table[c]);
        },
      };
    case "share":
      return { read: (i) => rgb(i).map((c) => LINEAR[c]), paint: () => rgb };
    case "direction":
      return { read: (i) => rgb(i).map((c) => (2 * c) / 255 - 1), paint: () => rgb };
    case "number": {
      const colours = colourMap("depth");
      const share = (/** @type {number} */ i) => { const c = bytes[4 * i] * 256 + bytes[4 * i + 1]; return c === NO_NUMBER ? Number.NaN : c / (NO_NUMBER - 1); };
      return {
        read: (i) => [picture.low + share(i) * span],
        paint: () => (i) => (Number.isNaN(share(i)) ? [128, 128, 128] : colours[Math.round(share(i) * 254)]),
      };
    }
    case "map": {
      const colours = colourMap("error");
      return {
        read: (i) => [bytes[4 * i] === 255 ? Number.NaN : picture.low + (bytes[4 * i] / 254) * span],
        paint: () => (i) => colours[bytes[4 * i]] ?? [128, 128, 128],
      };
    }
    default:
      return { read: () => [], paint: () => rgb };
  }
}

/** @param {Picture} picture @param {Record<string, string>} blobs @returns {Promise<Drawn>} */
async function decode(picture, blobs) {
  const { bytes } = await bytesOf(blobs[picture.webp]);
  const { read, paint } = meaning(picture, bytes);
  const { width, height } = picture;
  const canvas = document.createElement("canvas");
  canvas.width = width;
  canvas.height = height;
  const context = /** @type {CanvasRenderingContext2D} */ (canvas.getContext("2d"));
  const pixels = context.createImageData(width, height);
  let last = Number.NaN;
  return {
    width,
    height,
    read: (x, y) => read(y * width + x),
    draw: (stops) => {
      if (stops !== last) {
        const colour = paint(stops);
        for (let i = 0; i < width * height; i += 1) pixels.data.set([...colour(i), 255], 4 * i);
        context.putImageData(pixels, 0, 0);
        last = stops;
      }
      return canvas;
    },
  };
}

/** @param {number} value */
function shortNumber(value) {
  if (Number.isNaN(value)) return "none";
  const text = Math.abs(value) >= 100 ? value.toFixed(0) : Math.abs(value) >= 0.1 ? value.toFixed(3) : value.toPrecision(2);
  return (Math.abs(value) < 0.00005 ? "0" : text).replace("-", "\u2212");
}

/** @param {Drawn | undefined} drawn @param {Picture | null} picture @param {number[] | null} at
 * @param {boolean} [cut] True where values beyond the scale are shown as its ends. */
function valueText(drawn, picture, at, cut = false) {
  if (!drawn || !picture || !at) return "";
  const values = drawn.read(at[0], at[1]);
  if (picture.code === "map" && values[0] >= picture.high) return `\u2265 ${shortNumber(picture.high)}`;
  const ends = cut && picture.code === "number" && (values[0] >= picture.high ? "\u2265 " : values[0] <= picture.low ? "\u2264 " : "");
  return `${ends || ""}${values.map(shortNumber).join(", ")}`;
}

/** @param {string} text @param {string} [name] @param {string} [kind] */
function element(name = "span", text = "", kind = "") {
  const made = document.createElement(name);
  made.textContent = text;
  if (kind) made.className = kind;
  return made;
}

/** @param {Picture} picture */
const keyOf = (picture) => `${picture.webp} ${picture.low} ${picture.high} ${picture.code}`;

class Viewer {
  /** @param {HTMLElement} root @param {Gallery} gallery @param {string[]} names @param {Record<string, string>} blobs @param {string} truthName */
  constructor(root, gallery, names, blobs, truthName) {
    this.root = root;
    this.gallery = gallery;
    this.names = names;
    this.blobs = blobs;
    this.truthName = truthName;
    this.anchor = root.closest("[id]")?.id ?? "";
    /** @type {Map<string, Promise<Drawn>>} */
    this.decoding = new Map();
    /** @type {Map<string, Drawn>} */
    this.ready = new Map();
    this.view = 0;
    this.layer = 0;
    this.left = TRUTH;
    this.right = 0;
    this.mode = "split";
    this.error = false;
    /** Map of errors: ``error`` and ``noise`` lie in the page, the others are computed. */
    this.measure = "error";
    /** By measure and layer: null where they cannot be computed, undefined until they are. @type {Map<string, Maps | null | undefined>} */
    this.maps = new Map();
    /** What writes the notes of rows, which wait for a map. @type {(() => void)[]} */
    this.notes = [];
    this.divider = 50;
    this.stops = 0;
    this.zoom = 0;
    this.centre = [0.5, 0.5];
    /** @type {number[] | null} */
    this.at = null;
    /** @type {Pane[]} */
    this.panes = [];
    /** @type {Pane[]} */
    this.tiles = [];
    this.waiting = false;
    const template = need(document, "#viewer-parts", HTMLTemplateElement);
    root.append(template.content.cloneNode(true));
    this.stage = need(root, ".stage", HTMLElement);
    this.stage.setAttribute("aria-label", `Pictures of ${root.dataset.name ?? ""}. ${KEYS}`);
    this.wire();
    this.drawFilm();
    this.drawTabs();
    this.chooseFirst();
  }

  /** @returns {Layer[]} */
  get layers() { return this.gallery.views[this.view]?.rows ?? []; }

  /** @returns {Layer | undefined} */
  get shown() { return this.layers[this.layer]; }

  /** @param {number} row @returns {Tile | undefined} */
  tileOf(row) { return row === TRUTH ? this.shown?.truth : this.shown?.predictions[row]; }

  /** A map that lies in the page. @param {number} row @returns {Tile | undefined} */
  errorOf(row) { return row === TRUTH ? undefined : (this.measure === "noise" ? this.shown?.noise_ratios : this.shown?.errors)?.[row]; }

  /** Name of the maps that are shown. */
  get mapsKey() { return `${this.measure} ${this.shown?.title ?? ""}`; }

  /** The maps that are computed; undefined until they are, and for one that lies in the page; null where they cannot be. @returns {Maps | null | undefined} */
  computed() {
    const [measure, key] = [MEASURES[this.measure], this.mapsKey];
    if (!measure) return undefined;
    if (!this.maps.has(key)) {
      this.maps.set(key, undefined);
      computeMaps(this.gallery.views, this.shown?.title ?? "", measure, (picture) => this.decoded(picture)).catch(() => null).then((maps) => {
        this.maps.set(key, maps);
        if (key === this.mapsKey) this.tellMaps();
      });
    }
    return this.maps.get(key);
  }

  /** Show maps that have been computed, and leave in place what a reader may have in focus. */
  tellMaps() {
    need(this.root, ".of-errors .high", HTMLElement).textContent = this.errorEnd();
    for (const write of this.notes) write();
    this.redraw();
  }

  /** @param {number} row @returns {Drawn | undefined} */
  errorDrawn(row) { return MEASURES[this.measure] ? this.computed()?.drawn.get(`${this.view} ${row}`) : this.drawnOf(this.errorOf(row)?.picture); }

  /** What is said of a map: its mean, and what its colours span. @param {number} row */
  errorNote(row) {
    const [kept, mean] = [this.errorOf(row), this.computed()?.means.get(`${this.view} ${row}`)];
    if (!kept?.picture || (MEASURES[this.measure] && mean === undefined)) return kept?.note ?? "";
    return [mean === undefined ? kept.note : `mean ${mapNumber(mean)}`, `scale 0 to ${this.errorEnd()}`].filter(Boolean).join(", ");
  }

  /** @param {number} row */
  nameOf(row) { return row === TRUTH ? this.truthName : this.names[row]; }

  /** A decoded picture; one that is not yet is fetched and drawn later. @param {Picture | null | undefined} picture @returns {Drawn | undefined} */
  drawnOf(picture) {
    if (!picture) return undefined;
    this.decoded(picture);
    return this.ready.get(keyOf(picture));
  }

  /** @param {Picture} picture @returns {Promise<Drawn>} */
  decoded(picture) {
    const key = keyOf(picture);
    let coming = this.decoding.get(key);
    if (!coming) {
      coming = decode(picture, this.blobs);
      this.decoding.set(key, coming);
      coming.then((drawn) => { this.ready.set(key, drawn); this.redraw(); });
    }
    return coming;
  }

  /** @param {string} kind */
  input(kind) { return need(this.root, `.${kind}`, HTMLInputElement); }

  wire() {
    const { root } = this;
    root.addEventListener("recall", (event) => this.recall(/** @type {CustomEvent} */ (event).detail));
    for (const side of /** @type {const} */ (["left", "right"])) need(root, `select.${side}`, HTMLSelectElement).addEventListener("change", (event) => {
      this[side] = Number(/** @type {HTMLSelectElement} */ (event.target).value);
      this.arrange();
    });
    for (const button of root.querySelectorAll("[data-mode]")) button.addEventListener("click", () => { this.mode = /** @type {HTMLElement} */ (button).dataset.mode ?? "split"; this.arrange(); });
    this.input("divider").addEventListener("input", () => { this.divider = this.input("divider").valueAsNumber; this.redraw(); });
    this.input("exposure").addEventListener("input", () => { this.stops = this.input("exposure").valueAsNumber; this.redraw(); });
    this.input("zoom").addEventListener("input", () => { this.zoom = this.input("zoom").valueAsNumber; this.redraw(); });
    need(root, ".measure", HTMLSelectElement).addEventListener("change", (event) => { this.measure = /** @type {HTMLSelectElement} */ (event.target).value; this.arrange(); });
    need(root, ".reset", HTMLButtonElement).addEventListener("click", () => this.reset());
    need(root, ".more-layers", HTMLButtonElement).addEventListener("click", () => this.showNobody(!need(root, ".tabs", HTMLElement).classList.contains("shows-nobody")));
    this.stage.addEventListener("keydown", (event) => this.key(event));
    new ResizeObserver(() => this.redraw()).observe(this.stage);
  }

  reset() {
    Object.assign(this, { stops: 0, zoom: 0, divider: 50, centre: [0.5, 0.5], error: false });
    this.arrange();
  }

  drawFilm() {
    const film = need(this.root, ".film", HTMLElement);
    this.gallery.views.forEach((view, index) => {
      const button = /** @type {HTMLButtonElement} */ (element("button", "", "frame"));
      button.type = "button";
      const canvas = document.createElement("canvas");
      button.append(canvas, element("span", view.name));
      button.addEventListener("click", () => { this.view = index; this.drawTabs(); this.arrange(); });
      film.append(button);
      this.paintSmall(canvas, view.rows[0]?.truth.picture);
    });
    for (const picture of this.gallery.thumbnails) {
      const canvas = document.createElement("canvas");
      canvas.setAttribute("role", "img");
      canvas.setAttribute("aria-label", picture.alt);
      const figure = element("figure", "", "frame");
      figure.append(canvas, element("figcaption", picture.alt.replace(/.* /, "")));
      film.append(figure);
      this.paintSmall(canvas, picture);
    }
  }

  /** @param {HTMLCanvasElement} canvas @param {Picture | null | undefined} picture */
  async paintSmall(canvas, picture) {
    if (!picture) return;
    const drawn = await decode(picture, this.blobs);
    canvas.width = drawn.width;
    canvas.height = drawn.height;
    canvas.getContext("2d")?.drawImage(drawn.draw(0), 0, 0);
  }

  /** Layers that no row provides come last, and are hidden until they are asked for. */
  drawTabs() {
    const tabs = need(this.root, ".tabs", HTMLElement);
    tabs.replaceChildren();
    if (this.layer >= this.layers.length) this.layer = 0;
    const told = this.layers.map((row, index) => ({ row, index, given: row.predictions.some((tile) => tile.picture || tile.missing === "failed") }));
    for (const { row, index, given } of [...told.filter((t) => t.given), ...told.filter((t) => !t.given)]) {
      const tab = /** @type {HTMLButtonElement} */ (element("button", row.title.replace(/^Relit: The light '([^']*)'/, "Relit: $1"), given ? "" : "nobody"));
      tab.type = "button";
      tab.setAttribute("role", "tab");
      tab.dataset.layer = String(index);
      tab.title = row.title;
      tab.addEventListener("click", () => { this.layer = index; this.arrange(); });
      tab.addEventListener("keydown", (event) => {
        const step = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
        if (!step) return;
        const all = /** @type {HTMLElement[]} */ ([...tabs.children]).filter((other) => other.offsetParent !== null);
        const next = all[(all.indexOf(tab) + step + all.length) % all.length];
        next.click();
        next.focus();
        event.preventDefault();
      });
      tabs.append(tab);
    }
    const hidden = told.filter(({ given }) => !given).length;
    const more = need(this.root, ".more-layers", HTMLButtonElement);
    more.hidden = !hidden;
    more.dataset.words = `${hidden} ${hidden === 1 ? "layer" : "layers"} that no row provides`;
    this.showNobody(tabs.classList.contains("shows-nobody"));
  }

  /** @param {boolean} shown */
  showNobody(shown) {
    const more = need(this.root, ".more-layers", HTMLButtonElement);
    need(this.root, ".tabs", HTMLElement).classList.toggle("shows-nobody", shown);
    more.textContent = `${shown ? "Hide" : "Show"} ${more.dataset.words}`;
    more.setAttribute("aria-expanded", String(shown));
  }

  chooseFirst() {
    const rank = (/** @type {string} */ layer) => ["counterfactual.radiance", "base_color", "radiance"].indexOf(layer);
    const given = this.layers.map((row, index) => ({ index, rank: rank(row.layer), rows: row.predictions.filter((tile) => tile.picture).length, bare: Number(!row.truth.picture) }));
    const best = given.filter((g) => g.rows && g.rank >= 0).sort((a, b) => a.bare - b.bare || a.rank - b.rank)[0] ?? given.find((g) => g.rows);
    this.layer = best?.index ?? 0;
    this.right = Math.max(0, this.layers[this.layer]?.predictions.findIndex((tile) => tile.picture) ?? 0);
    if (this.names.length === 0) this.right = TRUTH;
    this.arrange();
  }

  /** Build what depends on view, layer and mode; then draw. */
  arrange() {
    const { root, shown } = this;
    if (!shown) return;
    const removal = shown.layer === "counterfactual.radiance";
    if (this.mode === "removal" && !removal) this.mode = "split";
    root.querySelectorAll(".film button").forEach((button, index) => button.setAttribute("aria-pressed", String(index === this.view)));
    for (const tab of root.querySelectorAll("[role=tab]")) {
      const chosen = Number(/** @type {HTMLElement} */ (tab).dataset.layer) === this.layer;
      tab.setAttribute("aria-selected", String(chosen));
      if (chosen && tab.classList.contains("nobody")) this.showNobody(true);
      /** @type {HTMLElement} */ (tab).tabIndex = chosen ? 0 : -1;
    }
    for (const button of root.querySelectorAll("[data-mode]")) {
      const mode = /** @type {HTMLElement} */ (button).dataset.mode;
      button.setAttribute("aria-pressed", String(mode === this.mode));
      if (mode === "removal") /** @type {HTMLElement} */ (button).hidden = !removal;
    }
    const whole = need(root, ".layer-title", HTMLElement);
    whole.textContent = shown.title;
    whole.hidden = shown.title.length <= LONG;
    need(root, ".bench", HTMLElement).setAttribute("aria-label", `${shown.title}, ${this.gallery.views[this.view].name}`);
    need(root, ".divider", HTMLElement).closest("label")?.toggleAttribute("hidden", this.mode !== "split");
    this.fillSelects();
    this.fillMeasures();
    this.buildPanes();
    this.buildTiles();
    this.buildReadout();
    this.redraw();
  }

  fillSelects() {
    for (const side of /** @type {const} */ (["left", "right"])) {
      const select = need(this.root, `select.${side}`, HTMLSelectElement);
      const rows = [TRUTH, ...this.names.keys()].filter((row) => this.tileOf(row)?.picture || row === this[side]);
      select.replaceChildren(...rows.map((row) => new Option(this.nameOf(row), String(row), false, row === this[side])));
    }
  }

  fillMeasures() {
    const layer = /** @type {Layer} */ (this.shown);
    const select = need(this.root, ".measure", HTMLSelectElement);
    const options = [new Option(ERRORS[layer.error_scale.unit] ?? "Error", "error")];
    if (layer.truth.picture) for (const [name, { title, fits }] of Object.entries(MEASURES)) if (fits(layer)) options.push(new Option(title, name));
    if (layer.noise_ratios.length) options.push(new Option("Error over noise", "noise"));
    if (!options.some(({ value }) => value === this.measure)) this.measure = "error";
    select.replaceChildren(...options);
    select.value = this.measure;
    const values = need(this.root, ".of-values", HTMLElement);
    const ends = layer.value_scale;
    values.hidden = !ends;
    need(values, ".low", HTMLElement).textContent = ends?.low ?? "";
    need(values, ".high", HTMLElement).textContent = `${ends?.high ?? ""} ${ends?.unit === "1" ? "" : ends?.unit ?? ""}`;
    const box = need(this.root, ".of-errors", HTMLElement);
    need(box, ".high", HTMLElement).textContent = this.errorEnd();
    box.hidden = !layer.errors.length;
    need(this.root, ".measures", HTMLElement).hidden = !layer.errors.length;
  }

  /** The upper end of the bar of errors, with its unit. */
  errorEnd() {
    const layer = /** @type {Layer} */ (this.shown);
    const scale = this.measure === "noise" ? layer.noise_scale : layer.error_scale;
    if (!MEASURES[this.measure]) return `${scale.high} ${scale.unit}`;
    const maps = this.computed();
    if (!maps) return maps === null ? "could not be computed" : "being computed";
    return `\u2265 ${mapNumber(maps.high).replace(/(\.\d*?)0+(?=e|$)/, "$1").replace(/\.(?=e|$)/, "")} ${MEASURES[this.measure].unit(layer)}`;
  }

  /** @param {string} label @param {string} spoken @param {() => (Drawn | undefined)[]} shown @returns {Pane} */
  pane(label, spoken, shown) {
    const canvas = document.createElement("canvas");
    canvas.setAttribute("role", "img");
    canvas.setAttribute("aria-label", spoken);
    this.follow(canvas);
    return { label, canvas, shown };
  }

  /** Light stands in for the truth of a layer that has none: a photograph. @param {number} row */
  pictureOf(row) { return this.tileOf(row)?.picture ?? (row === TRUTH ? this.layers.find((layer) => layer.layer === "radiance")?.truth.picture : undefined); }

  /** @param {number} row */
  value(row) { return () => [this.drawnOf(this.pictureOf(row))]; }

  buildPanes() {
    const [a, b] = [this.left, this.right];
    const title = this.shown?.title ?? "";
    const measured = MEASURES[this.measure]?.title ?? "error";
    const errorPane = (/** @type {number} */ row, label = `${measured} of ${this.nameOf(row)}`) => this.pane(label, `${title}: ${label}`, () => [this.errorDrawn(row)]);
    const before = this.layers.find((row) => row.layer === "radiance")?.truth.picture;
    switch (this.mode) {
      case "removal":
        this.panes = [
          this.pane("before", `${title}: before`, () => [this.drawnOf(before)]),
          this.pane(`after: ${this.nameOf(b)}`, `${title}: ${this.nameOf(b)}`, this.value(b)),
          this.pane("truth", `${title}: truth`, this.value(TRUTH)),
          errorPane(b, "what is left"),
        ];
        break;
      case "side":
        this.panes = [a, b].map((row) => this.pane(this.nameOf(row), `${title}: ${this.nameOf(row)}`, this.value(row)));
        break;
      case "flip":
        this.panes = [this.pane(this.error ? `${measured} of ${this.nameOf(b)}` : this.nameOf(b), `${title}: ${this.nameOf(b)}`, this.error ? () => [this.errorDrawn(b)] : this.value(b))];
        break;
      default:
        this.panes = [this.pane(`${this.nameOf(a)} | ${this.nameOf(b)}`, `${title}: ${this.nameOf(a)} left, ${this.nameOf(b)} right`, () => [this.drawnOf(this.pictureOf(a)), this.drawnOf(this.pictureOf(b))])];
    }
    const flipped = this.mode === "flip" && this.error;  // the error has the place of the row, and the row that of the error
    if (this.mode !== "removal" && this.errorOf(b)?.picture) this.panes.push(flipped ? this.pane(this.nameOf(b), `${title}: ${this.nameOf(b)}`, this.value(b)) : errorPane(b));
    need(this.stage, ".panes", HTMLElement).classList.toggle("four", this.panes.length === 4);
    need(this.stage, ".panes", HTMLElement).replaceChildren(...this.panes.map(({ label, canvas }) => {
      const figure = element("figure");
      figure.append(canvas, element("figcaption", label));
      return figure;
    }));
  }

  buildTiles() {
    this.tiles = [];
    this.notes = [];
    const place = need(this.root, ".tiles", HTMLElement);
    place.replaceChildren();
    for (const row of [TRUTH, ...this.names.keys()]) {
      const tile = this.tileOf(row);
      if (!tile || (row === TRUTH && !tile.picture)) continue;
      const figure = element("figure");
      if (row !== TRUTH) figure.dataset.row = this.nameOf(row);
      const button = /** @type {HTMLButtonElement} */ (element("button", this.nameOf(row), "method"));
      button.type = "button";
      button.addEventListener("click", () => { this.right = row; this.arrange(); });
      figure.append(button);
      if (tile.picture) {
        const { picture } = tile;
        const panes = [this.pane("", picture.alt, () => [this.drawnOf(picture)])];
        if (this.errorOf(row)?.picture) panes.push(this.pane("", "", () => [this.errorDrawn(row)]));
        this.tiles.push(...panes);
        figure.append(...panes.map(({ canvas }) => canvas));
      } else figure.append(element("div", tile.missing, `placeholder ${tile.missing.replace(" ", "-")}`));
      const note = element("span", "", "note");
      figure.append(note);
      this.notes.push(() => this.noteTile(row, note, figure.querySelectorAll("canvas")[1]));
      place.append(figure);
    }
    for (const write of this.notes) write();
    applyRows(place);
  }

  /** Write what is said of a row below its pictures. @param {number} row @param {HTMLElement} note @param {HTMLCanvasElement | undefined} map */
  noteTile(row, note, map) {
    const [tile, error, measure] = [this.tileOf(row), this.errorOf(row)?.picture, MEASURES[this.measure]];
    const said = tile?.picture ? this.errorNote(row) : "";
    note.textContent = [tile?.note, said].filter(Boolean).join("; ");
    note.hidden = !note.textContent;
    map?.setAttribute("aria-label", measure ? `${measure.title} of ${this.nameOf(row)}${said ? `, ${said}` : ""}` : error?.alt ?? "");
  }

  buildReadout() {
    const box = need(this.root, ".readout", HTMLElement);
    const rows = [TRUTH, ...this.names.keys()].filter((row) => this.tileOf(row)?.picture);
    need(box, "tbody", HTMLElement).replaceChildren(...rows.map((row) => {
      const line = element("tr");
      line.dataset.index = String(row);
      const head = element("th", this.nameOf(row));
      head.setAttribute("scope", "row");
      line.append(head, element("td"), element("td"));
      if (row !== TRUTH) line.dataset.row = this.nameOf(row);
      return line;
    }));
    applyRows(box);
    const layer = /** @type {Layer} */ (this.shown);
    const { values, precision, errors, error_scale } = layer;
    const measure = MEASURES[this.measure];
    const unit = measure?.unit(layer) ?? (this.measure === "noise" ? "standard deviations" : error_scale.unit);
    const units = [values, errors.length ? `errors in ${unit}` : ""].filter(Boolean).join("; ");
    const exact = measure ? `${precision.split(",")[0]}, errors computed from these` : errors.length ? precision : precision.split(",")[0];
    need(box, ".precision", HTMLElement).textContent = `Read from pictures: ${exact}${units ? ` (${units})` : ""}.`;
  }

  /** Where a canvas shows a pixel: zoomed about a centre that all share. @param {HTMLCanvasElement} canvas @param {Drawn} drawn */
  place(canvas, drawn) {
    const factor = 2 ** this.zoom;
    const scale = (canvas.width / drawn.width) * factor;
    const part = 0.5 / factor;
    const centre = this.centre.map((c) => Math.min(Math.max(c, part), 1 - part));
    return { scale, x: canvas.width / 2 - centre[0] * drawn.width * scale, y: canvas.height / 2 - centre[1] * drawn.height * scale };
  }

  redraw() {
    if (this.waiting) return;
    this.waiting = true;
    requestAnimationFrame(() => {
      this.waiting = false;
      for (const pane of [...this.panes, ...this.tiles]) this.paint(pane);
      this.tell();
    });
  }

  /** @param {Pane} pane */
  paint({ canvas, shown }) {
    const drawn = shown();
    const first = drawn[0] ?? drawn[1];
    const wide = Math.round(canvas.clientWidth * Math.min(window.devicePixelRatio, 2));
    if (!first || !wide) return;
    const high = Math.round((wide * first.height) / first.width);
    if (canvas.width !== wide || canvas.height !== high) Object.assign(canvas, { width: wide, height: high });
    canvas.style.aspectRatio = `${first.width} / ${first.height}`;
    const context = /** @type {CanvasRenderingContext2D} */ (canvas.getContext("2d"));
    context.imageSmoothingEnabled = false;
    context.clearRect(0, 0, wide, high);
    const cut = Math.round((wide * this.divider) / 100);
    drawn.forEach((picture, index) => {
      if (!picture) return;
      const { scale, x, y } = this.place(canvas, picture);
      context.save();
      if (drawn.length > 1) {
        context.beginPath();
        context.rect(index ? cut : 0, 0, index ? wide - cut : cut, high);
        context.clip();
      }
      context.drawImage(picture.draw(this.stops), x, y, picture.width * scale, picture.height * scale);
      context.restore();
    });
    if (drawn.length > 1) {
      context.fillStyle = "#ffffff";
      context.fillRect(cut - 1, 0, 3, high);
      context.fillStyle = "#000000";
      context.fillRect(cut, 0, 1, high);
    }
    if (this.at) {
      const { scale, x, y } = this.place(canvas, first);
      context.lineWidth = Math.max(1, wide / 300);
      for (const [colour, more] of /** @type {[string, number][]} */ ([["#000000", 2], ["#ffffff", 0]])) {
        context.strokeStyle = colour;
        context.strokeRect(x + this.at[0] * scale - more, y + this.at[1] * scale - more, scale + 2 * more, scale + 2 * more);
      }
    }
  }

  /** The error that is read. @param {number} row */
  errorText(row) {
    const drawn = this.errorDrawn(row);
    if (MEASURES[this.measure]) return drawn && this.at ? mapNumber(drawn.read(this.at[0], this.at[1])[0]) : "";
    return valueText(drawn, this.errorOf(row)?.picture ?? null, this.at);
  }

  /** Write the values under the pointer. */
  tell() {
    const box = need(this.root, ".readout", HTMLElement);
    const { at, shown } = this;
    const where = need(box, ".where", HTMLElement);
    where.textContent = at ? `${shown?.title}, row ${at[1]}, column ${at[0]}` : "Point at a pixel, or move with the arrow keys";
    for (const line of box.querySelectorAll("tr[data-index]")) {
      const row = Number(/** @type {HTMLElement} */ (line).dataset.index);
      const value = this.tileOf(row)?.picture ?? null;
      // The scale of distances is that of the truth alone; all others hold every value.
      line.children[1].textContent = valueText(this.drawnOf(value), value, at, row !== TRUTH && shown?.layer === "depth");
      line.children[2].textContent = row === TRUTH ? "" : this.errorText(row);
      line.classList.toggle("chosen", row === this.right);
    }
    const stops = `${this.stops > 0 ? "+" : this.stops < 0 ? "\u2212" : ""}${Math.abs(this.stops).toFixed(2)} stops`;
    for (const [kind, amount, text] of /** @type {[string, number, string][]} */ ([["exposure", this.stops, stops], ["zoom", this.zoom, `\u00d7 ${shortNumber(2 ** this.zoom).replace(/\.?0+$/, "")}`], ["divider", this.divider, `${this.divider} %`]])) {
      const input = this.input(kind);
      input.valueAsNumber = amount;
      input.setAttribute("aria-valuetext", text);
      const output = input.parentElement?.querySelector("output");
      if (output) output.textContent = text;
    }
    const query = this.state();
    need(this.root, ".permalink", HTMLAnchorElement).setAttribute("href", `#${this.anchor}?${query}`);
  }

  state() {
    const found = { view: this.gallery.views[this.view].name, layer: this.layer, left: this.nameOf(this.left), right: this.nameOf(this.right), mode: this.mode, zoom: this.zoom, exposure: this.stops, at: this.at?.join("-") ?? "", centre: this.centre.map((c) => c.toFixed(3)).join("-"), error: this.error ? "1" : "", measure: this.measure === "error" ? "" : this.measure };
    return Object.entries(found).filter(([, value]) => value !== "").map(([name, value]) => `${name}=${encodeURIComponent(String(value))}`).join("&");
  }

  /** @param {string} query */
  recall(query) {
    const found = new URLSearchParams(query);
    const view = this.gallery.views.findIndex((v) => v.name === found.get("view"));
    if (view >= 0) this.view = view;
    const layer = found.get("layer") ?? "";
    const named = this.layers.findIndex((row) => row.layer === layer);
    this.layer = named >= 0 ? named : Math.min(Math.max(0, Math.trunc(Number(layer)) || 0), this.layers.length - 1);
    for (const side of /** @type {const} */ (["left", "right"])) {
      const name = found.get(side);
      if (name !== null) this[side] = name === this.truthName || name === "truth" && !this.names.includes(name) ? TRUTH : Math.max(TRUTH, this.names.indexOf(name));
    }
    const mode = found.get("mode") ?? "";
    if (["split", "flip", "side", "removal"].includes(mode)) this.mode = mode;
    this.zoom = Math.min(Math.max(0, Number(found.get("zoom")) || 0), 5);
    this.stops = Math.min(Math.max(-6, Number(found.get("exposure")) || 0), 8);
    const pairs = (/** @type {string} */ name) => { const p = (found.get(name) ?? "").split("-").map(Number); return p.length === 2 && p.every(Number.isFinite) ? p : null; };
    const at = pairs("at");
    this.centre = pairs("centre") ?? [0.5, 0.5];
    this.error = found.has("error");
    this.measure = found.has("noise") ? "noise" : found.get("measure") ?? "error";
    this.drawTabs();
    this.arrange();
    if (at) this.moveTo(at[0], at[1]);
  }

  /** @param {number} x @param {number} y */
  moveTo(x, y) {
    const picture = this.tileOf(this.right)?.picture ?? this.shown?.truth.picture;
    if (!picture) return;
    this.at = [Math.min(Math.max(0, Math.floor(x)), picture.width - 1), Math.min(Math.max(0, Math.floor(y)), picture.height - 1)];
    this.redraw();
  }

  /** Read the pixel under the pointer; drag to move the divider or the picture. @param {HTMLCanvasElement} canvas */
  follow(canvas) {
    const pane = () => [...this.panes, ...this.tiles].find((p) => p.canvas === canvas);
    /** @type {{ x: number, y: number, centre: number[] } | null} */
    let held = null;
    canvas.addEventListener("pointermove", (event) => {
      const drawn = pane()?.shown().find(Boolean);
      if (!drawn) return;
      const box = canvas.getBoundingClientRect();
      if (held && this.zoom > 0) {
        const size = box.width * 2 ** this.zoom;
        this.centre = [held.centre[0] - (event.clientX - held.x) / size, held.centre[1] - (event.clientY - held.y) / (size * drawn.height / drawn.width)].map((c) => Math.min(Math.max(c, 0), 1));
      } else if (held && this.mode === "split") this.divider = Math.round(Math.min(Math.max(100 * (event.clientX - box.left) / box.width, 0), 100));
      const { scale, x, y } = this.place(canvas, drawn);
      const ratio = canvas.width / box.width;
      this.moveTo(((event.clientX - box.left) * ratio - x) / scale, ((event.clientY - box.top) * ratio - y) / scale);
    });
    canvas.addEventListener("pointerdown", (event) => {
      held = { x: event.clientX, y: event.clientY, centre: [...this.centre] };
      canvas.setPointerCapture(event.pointerId);
    });
    for (const name of ["pointerup", "pointercancel"]) canvas.addEventListener(name, () => { held = null; });
    canvas.addEventListener("wheel", (event) => {
      if (!event.ctrlKey) return;
      event.preventDefault();
      this.zoomBy(event.deltaY < 0 ? 0.5 : -0.5);
    }, { passive: false });
  }

  /** About the pixel that is read. @param {number} more */
  zoomBy(more) {
    this.zoom = Math.min(Math.max(0, this.zoom + more), 5);
    const picture = this.shown?.truth.picture;
    if (this.at && picture && more > 0) this.centre = [(this.at[0] + 0.5) / picture.width, (this.at[1] + 0.5) / picture.height];
    this.redraw();
  }

  /** @param {KeyboardEvent} event */
  key(event) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const far = event.shiftKey ? 8 : 1;
    const picture = this.shown?.truth.picture ?? this.tileOf(this.right)?.picture;
    const [x, y] = this.at ?? [Math.floor((picture?.width ?? 0) / 2), Math.floor((picture?.height ?? 0) / 2)];
    const step = (/** @type {number} */ dx, /** @type {number} */ dy) => { this.moveTo(x + dx * far, y + dy * far); requestAnimationFrame(() => this.say()); };
    const given = this.layers.map((row, index) => ({ row, index })).filter(({ row }) => row.predictions.some((tile) => tile.picture));
    /** @type {Record<string, () => void>} */
    const does = {
      ArrowLeft: () => step(-1, 0), ArrowRight: () => step(1, 0), ArrowUp: () => step(0, -1), ArrowDown: () => step(0, 1),
      " ": () => { [this.left, this.right] = [this.right, this.left]; this.arrange(); },
      e: () => { this.error = !this.error; this.mode = "flip"; this.arrange(); },
      m: () => { const modes = ["split", "flip", "side", ...(this.shown?.layer === "counterfactual.radiance" ? ["removal"] : [])]; this.mode = modes[(modes.indexOf(this.mode) + 1) % modes.length]; this.arrange(); },
      l: () => { const here = given.findIndex(({ index }) => index === this.layer); this.layer = given[(here + 1) % given.length]?.index ?? 0; this.arrange(); },
      v: () => { this.view = (this.view + 1) % this.gallery.views.length; this.drawTabs(); this.arrange(); },
      r: () => this.reset(),
      "+": () => this.zoomBy(0.5), "=": () => this.zoomBy(0.5), "-": () => this.zoomBy(-0.5),
      "[": () => { this.stops = Math.max(-6, this.stops - 0.5); this.redraw(); },
      "]": () => { this.stops = Math.min(8, this.stops + 0.5); this.redraw(); },
    };
    if (/^[0-9]$/.test(event.key)) {
      const row = Number(event.key) - 1;
      if (this.tileOf(row)?.picture) { this.right = row; if (this.mode === "split" || this.mode === "side") this.mode = "flip"; this.arrange(); }
    } else if (does[event.key.length === 1 ? event.key.toLowerCase() : event.key]) does[event.key.length === 1 ? event.key.toLowerCase() : event.key]();
    else return;
    event.preventDefault();
  }

  /** Speak what is read, for those who do not see it. */
  say() {
    const lines = [...this.root.querySelectorAll(".readout tr[data-index]")].map((line) => [...line.children].map((cell) => cell.textContent).filter(Boolean).join(" "));
    need(this.root, ".said", HTMLElement).textContent = `${need(this.root, ".where", HTMLElement).textContent}: ${lines.join("; ")}`;
  }
}

/** @param {HTMLElement} root */
async function buildViewer(root) {
  if (root.childElementCount) return;
  const id = root.dataset.pictures ?? "";
  const [kept, blobs] = await Promise.all([island("kept", id).then(inflate), blobsOf(id)]);
  const { pictures } = JSON.parse(kept);
  if (!pictures?.gallery.views.length || root.childElementCount) return;
  new Viewer(root, pictures.gallery, pictures.methods, blobs, root.dataset.truth ?? "ground truth");
}

start();
