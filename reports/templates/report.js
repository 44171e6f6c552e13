// Parts of a page that are drawn when they are opened, links to them, and the help of metrics.
"use strict";

/** @param {string} packed @returns {Promise<string>} */
async function inflate(packed) {
  const bytes = Uint8Array.from(atob(packed), (letter) => letter.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Response(stream).text();
}

/** @template {Element} T @param {ParentNode} root @param {string} selector @param {new () => T} kind @returns {T} */
function need(root, selector, kind) {
  const found = root.querySelector(selector);
  if (!(found instanceof kind)) throw new Error(`expected ${selector}, got none`);
  return found;
}

/** The rest of the page may still be on its way. @type {Promise<void>} */
const whole = new Promise((resolve) => {
  if (document.readyState === "loading") document.addEventListener("DOMContentLoaded", () => resolve(), { once: true });
  else resolve();
});

/** @param {string} kind @param {string} id @returns {Promise<string>} */
async function island(kind, id) {
  const selector = `script[data-${kind}="${CSS.escape(id)}"]`;
  if (!document.querySelector(selector)) await whole;
  return document.querySelector(selector)?.textContent ?? "";
}

/** Bytes of pictures by key, of each scene that was asked for. @type {Map<string, Promise<Record<string, string>>>} */
const blobStores = new Map();

/** @param {string} scene @returns {Promise<Record<string, string>>} */
function blobsOf(scene) {
  let found = blobStores.get(scene);
  if (!found) {
    found = island("blobs", scene).then((text) => JSON.parse(text || "{}"));
    blobStores.set(scene, found);
  }
  return found;
}

/** @param {HTMLElement} root @param {string} id */
async function dress(root, id) {
  const images = root.querySelectorAll("[data-blob]");
  if (images.length) {
    const blobs = await blobsOf(id.replace(/-worst$/, ""));
    for (const image of images) image.setAttribute("href", `data:image/webp;base64,${blobs[image.getAttribute("data-blob") ?? ""]}`);
  }
  for (const table of root.querySelectorAll("table")) if (table.matches(".scores")) dressTable(table, id);
  for (const button of root.querySelectorAll("[data-shows]")) if (button instanceof HTMLElement) makeShow(button);
  applyRows(root);
  for (const place of root.querySelectorAll(".viewer")) if (place instanceof HTMLElement) await buildViewer(place);
}

/** Say in its place that something cannot be drawn. @param {Element} place @param {unknown} cause */
function tellFault(place, cause) {
  const told = document.createElement("p");
  told.className = "trouble failure";
  told.textContent = `This cannot be drawn: ${cause instanceof Error ? cause.message : cause}. Try a newer browser, or another copy of the file.`;
  place.append(told);
}

/** @param {string} id @returns {Promise<HTMLElement>} */
async function drawn(id) {
  const content = document.createElement("div");
  content.className = "inside";
  content.innerHTML = await inflate(await island("part", id));
  return content;
}

/** @type {WeakMap<Element, Promise<void>>} */
const filled = new WeakMap();

/** Draw a part once. @param {HTMLDetailsElement} part @returns {Promise<void>} */
function fill(part) {
  let done = filled.get(part);
  if (!done) {
    done = drawn(part.id).then(async (content) => {
      part.append(content);
      await dress(content, part.id);
    }).catch((cause) => tellFault(part, cause));
    filled.set(part, done);
  }
  return done;
}

/** Number of times that claims were asked for: a late answer does not replace a newer one. */
let asked = 0;

/** @param {string} anchor */
async function showClaims(anchor) {
  const marks = [...document.querySelectorAll("a.mark")].map((mark) => mark.getAttribute("href")?.slice(1) ?? "");
  const wanted = anchor === "claims-all" ? marks : marks.includes(anchor) ? [anchor] : marks.filter((mark) => anchor.startsWith(`${mark}-`));
  if (!wanted.length) return;
  const panel = need(document, "#claim-panel", HTMLElement);
  asked += 1;
  const own = asked;
  const contents = await Promise.all(wanted.map(drawn)).catch((cause) => tellFault(panel, cause));
  if (!contents || own !== asked) return;
  panel.replaceChildren(...contents);
  for (const [index, content] of contents.entries()) await dress(content, wanted[index]);
  for (const mark of document.querySelectorAll("a.mark")) {
    if (wanted.length === 1 && mark.getAttribute("href") === `#${wanted[0]}`) mark.setAttribute("aria-current", "true");
    else mark.removeAttribute("aria-current");
  }
}

/** Open whatever holds an anchor: ids of parts begin the ids of what is inside. @param {string} anchor */
async function openTo(anchor) {
  if (anchor.startsWith("claim")) await showClaims(anchor);
  for (let depth = 0; depth < 4; depth += 1) {
    for (const part of document.querySelectorAll("details.part")) {
      if (part instanceof HTMLDetailsElement && part.id && (anchor === part.id || anchor.startsWith(`${part.id}-`))) {
        part.open = true;
        if (part.hasAttribute("data-part")) await fill(part);
      }
    }
  }
  const elsewhere = [...document.querySelectorAll("p.part[id] > a")].find((link) => link.parentElement && (anchor === link.parentElement.id || anchor.startsWith(`${link.parentElement.id}-`)));
  // In the place of this address: to go back must not lead here again.
  if (elsewhere instanceof HTMLAnchorElement) location.replace(`${elsewhere.getAttribute("href")?.split("#")[0]}${location.hash}`);
}

/** Text of an address; as it is where that is no code. @param {string} coded */
function plain(coded) {
  try {
    return decodeURIComponent(coded);
  } catch {
    return coded;
  }
}

async function follow() {
  const [place, query] = location.hash.slice(1).split("?");
  if (!place) return;
  const anchor = plain(place);
  await openTo(anchor);
  const target = document.getElementById(anchor);
  for (let held = target?.closest("details"); held; held = held.parentElement?.closest("details")) held.open = true;
  target?.scrollIntoView();
  const viewer = target?.querySelector(".viewer");
  if (query && viewer instanceof HTMLElement) {
    await buildViewer(viewer);
    viewer.dispatchEvent(new CustomEvent("recall", { detail: query }));
  }
  document.body.dataset.opened = anchor;
}

/** Rows and columns whose names hold one of some words; all where there are none. @type {string[]} */
let wantedRows = [];

/** @param {string} name */
const isWanted = (name) => !wantedRows.length || wantedRows.some((word) => name.toLowerCase().includes(word));

/** @param {ParentNode} root */
function applyRows(root) {
  for (const row of root.querySelectorAll("[data-row]")) row.classList.toggle("filtered", !isWanted(row.getAttribute("data-row") ?? ""));
  for (const table of root.querySelectorAll("table")) if (table.querySelector("[data-column]")) applyColumns(table);
}

/** @param {HTMLTableElement} table */
function applyColumns(table) {
  const heads = [...(table.tHead?.rows[0].cells ?? [])];
  const states = heads.map((head) => {
    const name = head.getAttribute("data-column");
    return { filtered: name !== null && !isWanted(name), variant: head.hasAttribute("data-variant") };
  });
  for (const row of table.rows) {
    if (row.cells.length !== heads.length) continue;
    [...row.cells].forEach((cell, index) => {
      cell.classList.toggle("filtered", states[index].filtered);
      cell.classList.toggle("variant", states[index].variant);
    });
  }
}

/** Put the help of a metric beside its name; without this script it stands at the foot of the window. @param {Element} button */
function placeTip(button) {
  const tip = document.getElementById(button.getAttribute("aria-describedby") ?? "");
  if (!tip) return;
  const place = button.getBoundingClientRect();
  tip.style.bottom = "auto";
  tip.style.left = `${Math.max(8, Math.min(place.left, document.documentElement.clientWidth - tip.offsetWidth - 8))}px`;
  const below = place.bottom + 8;
  const fits = below + tip.offsetHeight < window.innerHeight;
  tip.style.top = `${fits ? below : Math.max(8, place.top - tip.offsetHeight - 8)}px`;
}

/** @type {Element | null} */
let explained = null;

/** @param {Event} event */
function explain(event) {
  const button = event.target instanceof Element ? event.target.closest(".metric button") : null;
  if (!button) return;
  explained = button;
  document.body.classList.remove("dismissed");
  placeTip(button);
}

function start() {
  document.addEventListener("toggle", (event) => {
    const part = event.target;
    if (part instanceof HTMLDetailsElement && part.open && part.hasAttribute("data-part")) fill(part);
  }, true);
  document.addEventListener("mouseover", explain);
  document.addEventListener("focusin", explain);
  document.addEventListener("keydown", (event) => {
    if (event.key === "Escape") document.body.classList.add("dismissed");
  });
  // A focus that scrolls the page moves the name away from its help after the help was placed.
  document.addEventListener("scroll", () => { if (explained) placeTip(explained); }, { capture: true, passive: true });
  const filter = document.querySelector(".row-filter");
  if (filter instanceof HTMLInputElement) filter.addEventListener("input", () => {
    wantedRows = filter.value.toLowerCase().split(/[\s,]+/).filter(Boolean);
    applyRows(document);
    const names = [...document.querySelectorAll("[data-row]")].map((row) => row.getAttribute("data-row") ?? "");
    need(document, ".row-tools [role=status]", HTMLElement).textContent = names.some(isWanted) ? "" : "no row has this name";
  });
  const variants = document.querySelector(".show-variants");
  if (variants instanceof HTMLInputElement) variants.addEventListener("change", () => document.body.classList.toggle("fold", !variants.checked));
  // The bar at the top has as many lines as its names need; what sticks below it has to know.
  const bar = need(document, "nav", HTMLElement);
  const measure = () => document.documentElement.style.setProperty("--bar", `${bar.offsetHeight}px`);
  window.addEventListener("resize", measure);
  window.addEventListener("hashchange", follow);
  measure();
  for (const table of document.querySelectorAll("table.dots")) if (table instanceof HTMLTableElement) makeSortable(table);
  for (const place of document.querySelectorAll(".viewer")) if (place instanceof HTMLElement) buildViewer(place).catch((cause) => tellFault(place, cause));
  document.body.dataset.ready = "true";
  for (const part of document.querySelectorAll("details.part[open][data-part]")) if (part instanceof HTMLDetailsElement) fill(part);
  follow();
}
