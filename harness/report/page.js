"use strict";
(() => {
  const figures = [...document.querySelectorAll("figure")];
  const data = [...document.querySelectorAll('script[type="application/json"]')];

  // Runs what stands in the page as text, once and only when it is needed.
  function load(name) {
    const text = document.getElementById(name);
    if (!text || text.dataset.done) return;
    text.dataset.done = "yes";
    const script = document.createElement("script");
    script.textContent = `(function () {${text.textContent}\n}).call(window);`;
    document.head.append(script);
  }

  // Of panels in a line, of an axis beside them, of a letter, of a name at an axis, of a screen that is no phone [pixels].
  const WIDE = 560, AXIS = 70, LETTER = 6.5, NAME = 120, PHONE = 500;

  const lines = (text, room) => [text].flat().join(" ").match(new RegExp(`.{1,${Math.floor(room / LETTER)}}(\\s|$)`, "g"));

  // Makes a chart as narrow as a phone: fewer panels and entries of a legend in a line, shorter lines of text.
  function narrow(node, room) {
    const inside = room - AXIS, { title } = node;
    if (node.facet && node.spec) {
      node.columns = Math.min(node.columns ?? 1, 2);
      node.spec.width = (room - AXIS * node.columns) / node.columns;
    } else if (node.columns > 1) node.columns = Math.max(1, Math.floor(node.columns * inside / WIDE));
    if (node.width > inside) node.width = inside;
    if (node.axis?.labelFontSize) node.axis.labelLimit = NAME; // in the configuration
    if (typeof title === "string") node.title = lines(title, inside);
    for (const part of ["text", "subtitle"]) if (title?.[part]?.length) title[part] = lines(title[part], room);
    for (const [name, part] of Object.entries(node))
      if (part && typeof part === "object" && !["data", "from", "values"].includes(name)) narrow(part, room);
  }

  // Puts what moves in place of the still picture, which stays for print and for whatever fails.
  async function bring(figure, kind, json) {
    const element = document.createElement("div");
    element.className = `moving ${kind}`;
    load(kind);
    figure.querySelector(":scope > svg").after(element);
    const room = figure.clientWidth; // one panel gets as narrow as its place
    if (kind === "chart" && room < PHONE) narrow(json, room);
    if (json.height?.step) json.width = Math.min(json.width, room - NAME - 50); // vega-lite fits no such chart
    else if (json.width + 90 > room)
      Object.assign(json, { width: room, autosize: { type: "fit-x", contains: "padding" } });
    try {
      if (kind === "stage") element.shown = await window.screwgaugeStage(element, json);
      else element.shown = await window.vegaEmbed(element, json, { actions: false, ast: true, renderer: "svg", logLevel: 1 });
      figure.classList.add("live");
    } catch (error) {
      element.remove();
      console.error(error);
    }
  }

  const watch = new IntersectionObserver((entries) => {
    for (const { isIntersecting, target } of entries) {
      if (!isIntersecting) continue;
      watch.unobserve(target);
      const found = data[figures.indexOf(target)];
      bring(target, found.dataset.kind, JSON.parse(found.textContent));
    }
  }, { rootMargin: "300px" });
  const painted = () => figures.forEach((figure, i) => data[i] && data[i].dataset.kind && watch.observe(figure));
  requestAnimationFrame(() => requestAnimationFrame(painted)); // what is still is seen first

  // Saves a table as CSV, a figure as SVG and the points of a chart as CSV.
  const cell = (value) => {
    const text = String(value ?? "").replaceAll("\u00a0", " ").trim();
    const safe = /^[=+@-]./.test(text) && isNaN(text) ? `'${text}` : text; // a spreadsheet takes it for a formula
    return /[",\n]/.test(safe) ? `"${safe.replaceAll('"', '""')}"` : safe;
  };
  const csv = (rows) => `\ufeff${rows.map((row) => row.map(cell).join(",")).join("\n")}\n`;
  const named = (text) => text.toLowerCase().replace(/[^a-z0-9]+/g, "-").slice(0, 60).replace(/^-|-$/g, "") || "table";

  const LOOKS = ["s", "i", "kind", "colour", "dash", "shape", "hollow", "joined"];

  // Rows of described curves, each as its densest series; in differences, lines are drawn where zero is none.
  function curves({ values }, known) {
    const identity = ({ kind, s, colour, shape, component, ...rest }) => JSON.stringify(rest), best = {};
    const rank = ({ kind, pair }) => (pair ? ["asked", "line", "mark"] : ["line", "mark", "asked"]).indexOf(kind);
    for (const one of known) best[identity(one)] = Math.min(best[identity(one)] ?? 9, rank(one));
    return values.split("\n").slice(1).map((line) => line.split(",")).flatMap(([s, t, v]) =>
      rank(known[s]) === best[identity(known[s])] ? [{ ...known[s], t, v }] : []);
  }

  // Rows of a chart and of all charts within it: a column for each field, under the title of its axis if it has one.
  function rowsOf(view, above = {}) {
    const inner = ["vconcat", "concat", "layer"].flatMap((name) => view[name] ?? []).concat(view.spec ?? []);
    const axes = [above, view, ...inner].flatMap((one) => [...Object.values(one.encoding ?? {}), ...(one.axes ?? [])]);
    const titles = Object.fromEntries(axes.filter((x) => x?.title).map((x) => [x.field ?? x.scale, x.title]));
    titles.v ??= titles.y;
    const own = [view.data ?? []].flat().filter(({ name, values }) => values && !/_store$/.test(name));
    const rows = own.flatMap((data) => typeof data.values === "string"
      ? curves(data, view.transform[0].from.data.values) : data.values.map((row) => ({ panel: view.title?.text, ...row })));
    const renamed = rows.map((row) => Object.fromEntries(Object.entries(row).flatMap(([key, value]) =>
      LOOKS.includes(key) || value === undefined ? [] : [[titles[key] ?? key, value]])));
    return [...renamed, ...inner.flatMap((one) => rowsOf(one, view))];
  }

  function points(spec) {
    const rows = rowsOf({ ...spec, title: {} }), heads = [...new Set(rows.flatMap(Object.keys))];
    return csv([heads, ...rows.map((row) => heads.map((head) => row[head]))]);
  }

  function offer(name, forms) {
    const line = document.createElement("p");
    line.className = "save";
    for (const [form, [type, hint, make]] of Object.entries(forms)) {
      const button = document.createElement("button");
      Object.assign(button, { textContent: form, title: hint });
      button.addEventListener("click", () => {
        const link = document.createElement("a");
        link.href = URL.createObjectURL(new Blob([make()], { type }));
        link.download = `${named(name)}.${form.toLowerCase()}`;
        link.click();
        setTimeout(() => URL.revokeObjectURL(link.href), 1e4);
      });
      line.append(button);
    }
    return line;
  }

  for (const table of document.querySelectorAll(".scroll:not(.facts) table")) {
    const above = [...document.querySelectorAll("h1, h2")].filter((head) => head.compareDocumentPosition(table) & 4);
    const rows = () => csv([...table.rows].map((row) => [...row.cells].map((one) => one.textContent)));
    table.parentElement.after(offer(above.at(-1).textContent, { CSV: ["text/csv", "Save this table", rows] }));
  }
  figures.forEach((figure, i) => {
    const still = figure.querySelector(":scope > svg");
    if (!still || !data[i]) return;
    const forms = { SVG: ["image/svg+xml", "Save this picture", () => new XMLSerializer().serializeToString(still)] };
    if (data[i].dataset.kind === "chart") {
      const hint = "Save the points that are drawn; run --csv writes every sample";
      forms.CSV = ["text/csv", hint, () => points(JSON.parse(data[i].textContent))];
    }
    figure.append(offer(still.getAttribute("aria-label"), forms));
  });

  // Whatever a link leads to is open.
  function reveal() {
    const target = document.getElementById(decodeURIComponent(location.hash.slice(1)));
    for (let at = target; at; at = at.parentElement) if (at.tagName === "DETAILS") at.open = true;
    if (target) target.scrollIntoView();
  }
  addEventListener("hashchange", reveal);
  if (location.hash) reveal();

  let opened = [];
  addEventListener("beforeprint", () => {
    opened = [...document.querySelectorAll("details:not([open], .more)")];
    for (const fold of opened) fold.open = true;
  });
  addEventListener("afterprint", () => {
    for (const fold of opened) fold.open = false;
  });
})();
