// Tables: sort by any column, find rows, copy for a paper, link.

/** The number that a cell shows; NaN for a dash, a word or a hash. @param {Element | undefined} cell */
function numberOf(cell) {
  const told = cell?.getAttribute("data-value");
  if (told) return Number(told);
  if (!cell || cell.tagName === "TH" || cell.querySelector("code")) return Number.NaN;
  const shown = cell.querySelector(".value") ?? cell.querySelector("a") ?? cell;
  const text = [...shown.childNodes].filter((node) => node.nodeType === Node.TEXT_NODE).map((node) => node.textContent).join("") || shown.textContent || "";
  const plain = text.trim().replace("\u2212", "-").replace("\u221e", "Infinity");
  return /^-?(Infinity|[\d.])/.test(plain) ? Number.parseFloat(plain) : Number.NaN;
}

/** Text of a cell without what only explains it; what a mean lacks stays. @param {Element} cell */
function textOf(cell) {
  const copy = /** @type {Element} */ (cell.cloneNode(true));
  for (const note of copy.querySelectorAll(".lacks")) note.replaceWith(` (${note.textContent})`);
  for (const more of copy.querySelectorAll(".tip, .note, svg, .aside, .badge, .arrow, .breakdown, .sort")) more.remove();
  return (copy.textContent ?? "").replace(/\s+/g, " ").trim();
}

/** @param {HTMLTableElement} table @param {number} column @param {boolean} up */
function sortRows(table, column, up) {
  for (const body of table.tBodies) {
    const rows = [...body.rows].filter((row) => row.cells.length > column && !row.classList.contains("group"));
    const key = (/** @type {HTMLTableRowElement} */ row) => numberOf(row.cells[column]);
    const words = rows.every((row) => Number.isNaN(key(row)));
    rows.sort((a, b) => {
      if (words) return (up ? 1 : -1) * textOf(a.cells[column]).localeCompare(textOf(b.cells[column]));
      const [x, y] = [key(a), key(b)];
      if (Number.isNaN(x) || Number.isNaN(y)) return Number(Number.isNaN(x)) - Number(Number.isNaN(y));
      return x === y ? 0 : (up ? 1 : -1) * (x < y ? -1 : 1);
    });
    for (const row of rows) body.append(row);
  }
}

/**
 * True if a column begins with its least: words, places, and metrics of which less is better. Others begin with the most.
 * @param {HTMLTableElement} table @param {HTMLTableCellElement} head @param {number} column
 */
function beginsWithLeast(table, head, column) {
  if (textOf(head) === "#" || head.querySelector(".arrow")?.textContent === "↓") return true;
  return [...table.tBodies].every((body) => [...body.rows].every((row) => row.cells.length <= column || Number.isNaN(numberOf(row.cells[column]))));
}

/** @param {HTMLTableElement} table */
function makeSortable(table) {
  [...(table.tHead?.rows[0]?.cells ?? [])].forEach((head, column) => {
    const button = document.createElement("button");
    button.type = "button";
    button.className = "sort";
    button.textContent = "↕";
    button.setAttribute("aria-label", `Sort by ${textOf(head) || "row"}`);
    button.addEventListener("click", () => {
      const sorted = head.getAttribute("aria-sort");
      const up = sorted ? sorted === "descending" : beginsWithLeast(table, head, column);
      for (const other of table.tHead?.rows[0]?.cells ?? []) {
        other.removeAttribute("aria-sort");
        need(other, ".sort", HTMLElement).textContent = "↕";
      }
      head.setAttribute("aria-sort", up ? "ascending" : "descending");
      button.textContent = up ? "↑" : "↓";
      sortRows(table, column, up);
    });
    head.append(button);
  });
}

/**
 * A cell as it is copied: its text, what of that is no value, the ends of its interval, badges, and notes and words for its foot.
 * @typedef {{ text: string, best?: boolean, lacks?: string, low?: string, high?: string, badges?: string[], notes?: string[], words?: string[] }} Copied
 */

/** @param {HTMLTableCellElement} cell @returns {Copied} */
function copied(cell) {
  const texts = (/** @type {string} */ selector) => [...cell.querySelectorAll(selector)].map((part) => part.textContent ?? "");
  const words = /** @type {HTMLElement[]} */ ([...cell.querySelectorAll(".badge[title], abbr[title]")]).map((part) => `${part.textContent}: ${part.title}`);
  return { text: textOf(cell), best: cell.classList.contains("best"), lacks: texts(".lacks").join("; "), low: cell.dataset.low, high: cell.dataset.high, badges: texts(".badge"), notes: texts(".foot"), words };
}

/** What a paper shows of a cell, and the lines below the table: marks with their notes, then words and the meaning of brackets.
 * @param {Copied[][]} rows */
function withFoot(rows) {
  const cells = rows.flat();
  const notes = [...new Set(cells.flatMap((cell) => cell.notes ?? []))];
  const mark = (/** @type {string} */ note) => String.fromCharCode(97 + notes.indexOf(note) % 26).repeat(1 + Math.floor(notes.indexOf(note) / 26));
  const words = new Set(cells.flatMap((cell) => cell.words ?? []));
  if (cells.some((cell) => cell.low)) words.add("[low, high]: 95 % interval");
  return {
    name: (/** @type {Copied} */ { text, badges = [] }) => [text, badges.length ? `(${badges.join("; ")})` : ""].join(" ").trim(),
    ends: (/** @type {Copied} */ { low, high }) => (low ? ` [${low}, ${high}]` : ""),
    marks: (/** @type {Copied} */ { notes: own = [] }) => own.map(mark).join(", "),
    feet: [...notes.map((note) => [mark(note), note]), ...[...words].map((word) => ["", word])],
  };
}

/** Cells that are seen. @param {HTMLTableElement} table @returns {Copied[][]} */
function seenCells(table) {
  const rows = [...table.rows].filter((row) => row.offsetParent !== null && !row.classList.contains("axes"));
  return rows.map((row) => [...row.cells].filter((cell) => cell.offsetParent !== null).map(copied));
}

/** A column of means with intervals as value, low and high, and as a note where a mean lacks something.
 * @param {Copied[][]} rows @returns {string[][]} */
function withIntervals(rows) {
  const [, ...body] = rows;
  const wide = rows[0].map((_, column) => body.some((cells) => cells[column]?.low !== undefined));
  const noted = rows[0].map((_, column) => wide[column] && body.some((cells) => cells[column]?.lacks));
  return rows.map((cells, index) => cells.flatMap((cell, column) => {
    if (!wide[column]) return [cell.text];
    const note = (/** @type {string} */ text) => (noted[column] ? [text] : []);
    if (!index) return [...["value", "low", "high"].map((end) => `${cell.text}: ${end}`), ...note(`${cell.text}: note`)];
    return [cell.lacks ? cell.text.replace(/ \(.*/, "") : cell.text, cell.low ?? "", cell.high ?? "", ...note(cell.lacks ?? "")];
  }));
}

/** Text that no spreadsheet takes for a formula, as names may begin like one; numbers stay. @param {string} text */
const inert = (text) => (/^[=+@]|^-(?![\d.\u221e][^=+@!|*/^&"'<>:]*$)/.test(text) ? `'${text}` : text);

/** Markdown and LaTeX have what is seen, the best in bold and notes at the foot; CSV has the ends of intervals in columns.
 * @type {Record<string, (rows: Copied[][], caption: string) => string>} */
const WRITERS = {
  markdown(rows) {
    const { name, ends, marks, feet } = withFoot(rows);
    const safe = (/** @type {string} */ text) => text.replace(/[\\|<>*`[\]]/g, "\\$&");
    const raised = (/** @type {string} */ text) => (text ? `<sup>${text}</sup>` : "");
    const shown = (/** @type {Copied} */ cell) => (cell.best ? `**${safe(name(cell))}**` : safe(name(cell))) + safe(ends(cell)) + raised(marks(cell));
    const line = (/** @type {Copied[]} */ cells) => `| ${cells.map(shown).join(" | ")} |`;
    const [head, ...body] = rows;
    const table = [line(head), `| ${head.map(() => "---").join(" | ")} |`, ...body.map(line)].join("\n");
    return [table, ...feet.map(([letter, note]) => `${raised(letter)} ${safe(note)}`.trim())].join("\n\n");
  },
  csv(rows) {
    const quoted = (/** @type {string} */ cell) => (/[",\n]/.test(cell) ? `"${cell.replace(/"/g, '""')}"` : cell);
    return withIntervals(rows).map((cells) => cells.map((cell) => quoted(inert(cell.replaceAll("\u2212", "-")))).join(",")).join("\n");
  },
  latex(rows, caption) {
    /** @type {Record<string, string>} */
    const letters = { "\\": "\\textbackslash{}", "~": "\\textasciitilde{}", "^": "\\textasciicircum{}", "\u2212": "$-$", "\u221e": "$\\infty$", "\u2013": "--", "°": "$^\\circ$", "×": "$\\times$", "≥": "$\\geq$", "≤": "$\\leq$", "±": "$\\pm$", "·": "$\\cdot$", "²": "$^2$", "σ": "$\\sigma$", "Δ": "$\\Delta$", "→": "$\\to$", "…": "\\ldots{}", "<": "\\textless{}", ">": "\\textgreater{}", "|": "\\textbar{}" };
    const { name, ends, marks, feet } = withFoot(rows);
    const safe = (/** @type {string} */ text) => text.replace(/[\\~^\u2212\u221e\u2013°×≥≤±·²σΔ→…<>|]|[&%$#_{}]/g, (letter) => letters[letter] ?? `\\${letter}`);
    const raised = (/** @type {string} */ text) => (text ? `\\textsuperscript{${text}}` : "");
    const shown = (/** @type {Copied} */ cell) => (cell.best ? `\\textbf{${safe(name(cell))}}` : safe(name(cell))) + safe(ends(cell)) + raised(marks(cell));
    const [head, ...body] = rows.map((cells) => `${cells.map(shown).join(" & ")} \\\\`);
    return [`\\begin{tabular}{${rows[0].map((_, column) => (rows.slice(1).some((cells) => /^[A-Za-z]/.test(cells[column]?.text ?? "") && cells[column].text !== "failed") ? "l" : "r")).join("")}}`, `% ${caption}`, "\\toprule", head, "\\midrule", ...body, "\\bottomrule", "\\end{tabular}", ...feet.map(([letter, note]) => `\\par{\\footnotesize ${`${raised(letter)} ${safe(note)}`.trim()}}`)].join("\n");
  },
};

/** @param {string} text @returns {Promise<void>} */
async function copyText(text) {
  try {
    await navigator.clipboard.writeText(text);
  } catch {
    const area = document.createElement("textarea");  // pages that are opened as files may have no clipboard
    area.value = text;
    document.body.append(area);
    area.select();
    document.execCommand("copy");
    area.remove();
  }
  document.body.dataset.copied = text;
}

/** Show or hide what nobody provides. @param {HTMLElement} button */
function makeShow(button) {
  button.addEventListener("click", () => {
    const shown = button.getAttribute("aria-expanded") !== "true";
    document.getElementById(button.dataset.shows ?? "")?.classList.toggle("shows-nobody", shown);
    button.setAttribute("aria-expanded", String(shown));
    button.textContent = shown ? "Hide" : "Show";
  });
}

/** @param {HTMLTableElement} table @param {string} part */
function dressTable(table, part) {
  const place = table.closest(".scroll");
  if (!place?.parentElement) return;
  makeSortable(table);
  const template = need(document, "#table-tools", HTMLTemplateElement);
  const tools = need(/** @type {DocumentFragment} */ (template.content.cloneNode(true)), ".table-tools", HTMLElement);
  for (let number = 1; !table.id; number += 1) if (!document.getElementById(`${part}-table-${number}`)) table.id = `${part}-table-${number}`;
  const caption = table.caption ? textOf(table.caption) : "";
  const find = need(tools, ".find", HTMLInputElement);
  find.setAttribute("aria-label", `Find in ${caption}`);
  find.addEventListener("input", () => {
    const words = find.value.toLowerCase().split(/\s+/).filter(Boolean);
    let found = 0;
    for (const body of table.tBodies) {
      const rows = [...body.rows].filter((row) => row.cells.length > 1);
      for (const row of rows) {
        const text = (row.textContent ?? "").toLowerCase();
        row.hidden = !words.every((word) => text.includes(word));
      }
      const left = rows.filter((row) => !row.hidden).length;
      for (const row of body.rows) if (row.cells.length === 1) row.hidden = !left && words.length > 0;
      found += left;
    }
    need(tools, ".copied", HTMLElement).textContent = found ? "" : "no row has this";
  });
  for (const button of tools.querySelectorAll("button")) button.addEventListener("click", async () => {
    const rows = seenCells(table).filter((cells) => cells.length > 1);
    await copyText(WRITERS[button.dataset.copy ?? "csv"](rows, caption));
    need(tools, ".copied", HTMLElement).textContent = `${rows.length} lines copied`;
  });
  const link = need(tools, ".permalink", HTMLAnchorElement);
  link.href = `#${table.id}`;
  link.setAttribute("aria-label", `Link to ${caption}`);
  place.before(tools);
}
