"use strict";
(() => {
  const knee = Number(document.body.dataset.knee);
  const step = Number(document.body.dataset.step);
  const sources = JSON.parse(document.getElementById("linear").textContent);
  const levels = Number(document.body.dataset.levels);

  /** Display value in [0, 1] of linear light, IEC 61966-2-1. */
  const srgb = (x) => (x <= 0.0031308 ? 12.92 * x : 1.055 * Math.min(x, 1) ** (1 / 2.4) - 0.055);

  /** 8-bit display value of each code of linear light, seen through an exposure in stops. */
  function displayTable(stops) {
    const table = new Uint8ClampedArray(levels);
    const gain = knee * 2 ** stops;
    for (let code = 0; code < levels; code += 1) table[code] = 255 * srgb(gain * Math.expm1(code * step));
    return table;
  }

  /** The codes of a picture: high bytes in the upper half of the PNG, low bytes in the lower half. */
  async function readCodes(source) {
    const image = new Image();
    image.src = source;
    await image.decode();
    const canvas = document.createElement("canvas");
    canvas.width = image.naturalWidth;
    canvas.height = image.naturalHeight;
    const context = canvas.getContext("2d", { willReadFrequently: true });
    context.drawImage(image, 0, 0);
    const bytes = context.getImageData(0, 0, canvas.width, canvas.height).data;
    const half = bytes.length / 2;
    const codes = Uint16Array.from({ length: half }, (_, i) => bytes[i] * 256 + bytes[half + i]);
    return { codes, width: canvas.width, height: canvas.height / 2 };
  }

  /** Put a canvas in the place of a picture; gives a function that paints it through a table. */
  async function makeCanvas(image) {
    const { codes, width, height } = await readCodes(sources[Number(image.dataset.linear)]);
    const canvas = document.createElement("canvas");
    canvas.width = width;
    canvas.height = height;
    canvas.className = image.className;
    canvas.style.setProperty("--shown", `${image.getAttribute("width")}px`);
    canvas.setAttribute("role", "img");
    canvas.setAttribute("aria-label", image.alt);
    const context = canvas.getContext("2d");
    const pixels = context.createImageData(width, height);
    image.replaceWith(canvas);
    return (table) => {
      for (let i = 0; i < codes.length; i += 1) pixels.data[i] = i % 4 === 3 ? 255 : table[codes[i]];
      context.putImageData(pixels, 0, 0);
    };
  }

  async function followExposure(scene) {
    const slider = scene.querySelector(".exposure");
    const output = scene.querySelector("output");
    const painters = await Promise.all([...scene.querySelectorAll("img[data-linear]")].map(makeCanvas));
    const paint = () => {
      const stops = Number(slider.value);
      const sign = stops > 0 ? "+" : stops < 0 ? "\u2212" : "";
      output.textContent = `${sign}${Math.abs(stops).toFixed(2)} stops`;
      slider.setAttribute("aria-valuetext", output.textContent);
      const table = displayTable(stops);
      painters.forEach((painter) => painter(table));
    };
    slider.addEventListener("input", paint);
    scene.querySelector(".reset").addEventListener("click", () => {
      slider.value = 0;
      paint();
    });
    paint();
  }

  function switchViews(scene) {
    const views = scene.querySelectorAll(".view");
    const show = (chosen) => views.forEach((view) => { view.hidden = view.dataset.view !== chosen; });
    const buttons = scene.querySelectorAll(".views input");
    buttons.forEach((button) => button.addEventListener("change", () => show(button.value)));
    const checked = [...buttons].find((button) => button.checked);
    if (checked) show(checked.value);
  }

  /** Put the help of a metric beside its name; without this script it stands at the foot of the window. */
  function placeTip(button) {
    const tip = document.getElementById(button.getAttribute("aria-describedby"));
    const place = button.getBoundingClientRect();
    tip.style.bottom = "auto";
    tip.style.left = `${Math.max(8, Math.min(place.left, document.documentElement.clientWidth - tip.offsetWidth - 8))}px`;
    const below = place.bottom + 8;
    const fits = below + tip.offsetHeight < window.innerHeight;
    tip.style.top = `${fits ? below : Math.max(8, place.top - tip.offsetHeight - 8)}px`;
  }

  let explained = null;
  const explain = (button) => {
    explained = button;
    document.body.classList.remove("dismissed");
    placeTip(button);
  };

  document.querySelectorAll(".metric button").forEach((button) => {
    for (const event of ["mouseenter", "focus"]) button.addEventListener(event, () => explain(button));
  });
  document.addEventListener("keydown", (event) => {
    if (event.key === "Escape") document.body.classList.add("dismissed");
  });
  // A focus that scrolls the page moves the name away from its help after the help was placed.
  document.addEventListener("scroll", () => { if (explained) placeTip(explained); }, { capture: true, passive: true });

  // The bar at the top has as many lines as its names need; what sticks below it has to know.
  const bar = document.querySelector("nav");
  const measure = () => document.documentElement.style.setProperty("--bar", `${bar.offsetHeight}px`);
  window.addEventListener("resize", measure);
  measure();

  const scenes = [...document.querySelectorAll(".scene")].filter((scene) => scene.querySelector(".controls"));
  scenes.forEach(switchViews);
  Promise.all(scenes.map(followExposure)).then(() => {
    scenes.forEach((scene) => { scene.querySelector(".controls").hidden = false; });
    document.body.dataset.ready = "true";
  });
})();
