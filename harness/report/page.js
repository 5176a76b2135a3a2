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

  // Puts what moves in place of the still picture, which stays for print and for whatever fails.
  async function bring(figure, kind, json) {
    const element = document.createElement("div");
    element.className = `moving ${kind}`;
    load(kind);
    figure.append(element);
    const room = figure.clientWidth; // one panel gets as narrow as its place; several, or on a phone, scroll
    if (json.width + 90 > room && room > 500)
      Object.assign(json, { width: room, autosize: { type: "fit-x", contains: "padding" } });
    try {
      if (kind === "stage") element.shown = await window.screwgaugeStage(element, json);
      else element.shown = await window.vegaEmbed(element, json, { actions: false, ast: true, renderer: "svg" });
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
