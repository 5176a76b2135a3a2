"use strict";
/* The mechanism in space, drawn by MeshCat's viewer. `data` is what stage/picture.py writes: lengths in lengths of the
   mechanism, z up. Returns what steers it; throws where there is no WebGL, and the element is left as it was. */
function screwgaugeStage(element, data) {
  const wrap = make("div", {className: "stage"}), pane = make("div", {tabIndex: 0});
  const style = `position:relative;height:min(62vh,${element.clientWidth < 600 ? 340 : 480}px);min-height:260px;overflow:hidden;outline-offset:-2px`;
  pane.style.cssText = style;
  pane.setAttribute("role", "img");
  pane.setAttribute("aria-label", `${data.title} in space; drag to turn, after a click scroll to zoom`);
  wrap.append(pane);
  element.append(wrap);
  const loaded = window.onload;
  let viewer;
  try {
    viewer = new MeshCat.Viewer(pane);
  } catch (error) {
    wrap.remove();
    throw error;
  } finally {
    window.onload = loaded; // the viewer takes it for its own
  }
  viewer.gui.domElement.remove();
  viewer.renderer.domElement.style.display = "block";
  const fit = viewer.set_3d_pane_size.bind(viewer);
  viewer.set_3d_pane_size = () => pane.clientWidth && fit(pane.clientWidth, pane.clientHeight);
  new ResizeObserver(() => viewer.set_3d_pane_size()).observe(pane);
  const send = (type, path, more) => viewer.handle_command({type, path, ...more});
  const show = (path, value) => send("set_property", path, {property: "visible", value});
  for (const path of ["/Background", "/Grid", "/Axes"]) show(path, false);

  // ---- vectors and matrices, column by column as three.js has them
  const add = (a, b, k = 1) => a.map((x, i) => x + k * b[i]), dot = (a, b) => a.reduce((s, x, i) => s + x * b[i], 0);
  const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  const times = (a, k) => a.map(x => k * x), size = a => Math.sqrt(dot(a, a)), unit = a => times(a, 1 / (size(a) || 1));
  const matrix = (x, y, z, p) => [...x, 0, ...y, 0, ...z, 0, ...p, 1];
  function along(a, b, thick, long = size(add(b, a, -1))) { // of a solid about y between two points
    const y = unit(add(b, a, -1)), x = unit(cross(y, Math.abs(y[2]) < 0.9 ? [0, 0, 1] : [1, 0, 0]));
    return matrix(times(x, thick), times(y, Math.max(long, 1e-6)), times(cross(x, y), thick), times(add(a, b), 0.5));
  }
  function placed(q) { // position and quaternion
    const [px, py, pz, w, x, y, z] = q;
    return matrix([1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w)], [2 * (x * y - z * w), 1 - 2 * (x * x + z * z), 2 * (y * z + x * w)],
      [2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y)], [px, py, pz]);
  }
  const moved = (m, p) => [0, 1, 2].map(i => m[i] * p[0] + m[4 + i] * p[1] + m[8 + i] * p[2] + m[12 + i]);

  // ---- solids
  const SOLIDS = {
    rod: {type: "CylinderGeometry", radiusTop: 1, radiusBottom: 1, height: 1, radialSegments: 20},
    head: {type: "CylinderGeometry", radiusTop: 0, radiusBottom: 1, height: 1, radialSegments: 20},
    box: {type: "BoxGeometry", width: 2, height: 1, depth: 2},
    ball: {type: "SphereGeometry", radius: 1, widthSegments: 24, heightSegments: 16},
    cage: {type: "SphereGeometry", radius: 1, widthSegments: 8, heightSegments: 6},
    ring: {type: "TorusGeometry", radius: 1, tube: 0.16, radialSegments: 10, tubularSegments: 36},
    foot: {type: "CylinderGeometry", radiusTop: 0.35, radiusBottom: 1, height: 0.8, radialSegments: 4},
  };
  let count = 0;
  function solid(path, kind, colour, m, opacity = 1) {
    const id = `${++count}`;
    const object = {uuid: "o" + id, type: "Mesh", geometry: "g" + id, material: "m" + id, matrix: matrix([1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 0, 0])};
    const material = {uuid: "m" + id, type: "MeshPhongMaterial", color: parseInt(colour.slice(1), 16), shininess: 25, wireframe: kind === "cage",
      transparent: opacity < 1, opacity, depthWrite: opacity === 1};
    send("set_object", path, {object: {metadata: {version: 4.5, type: "Object"}, geometries: [{uuid: "g" + id, ...SOLIDS[kind]}], materials: [material], object}});
    if (m) send("set_transform", path, {matrix: m});
  }
  function arrow(path, colour, a, b, r) {
    const neck = add(b, times(unit(add(b, a, -1)), -5 * r));
    solid(`${path}/rod`, "rod", colour, along(a, neck, r));
    solid(`${path}/head`, "head", colour, along(neck, b, 2.4 * r));
  }
  const slides = [], groups = new Set();
  data.shapes.forEach((s, n) => {
    const path = `/b${s.i}/${s.g}/${n}`, at = m => matrix([m, 0, 0], [0, m, 0], [0, 0, m], s.a);
    groups.add(s.g);
    if (s.k === "slide") {
      solid(`/slides/${n}`, "rod", s.c, null);
      slides.push([`/slides/${n}`, s]);
    } else if (s.k === "rod" || s.k === "box") {
      solid(path, s.k, s.c, along(s.a, s.b, s.r));
      if (s.g === "links") [s.a, s.b].forEach((p, i) => solid(`${path}-${i}`, "ball", s.c, matrix([s.r, 0, 0], [0, s.r, 0], [0, 0, s.r], p)));
    } else if (s.k === "arrow") arrow(path, s.c, s.a, s.b, s.r);
    else if (s.k === "ring") {
      const z = unit(add(s.b, s.a, -1)), x = unit(cross(z, Math.abs(z[2]) < 0.9 ? [0, 0, 1] : [1, 0, 0]));
      solid(path, "ring", s.c, matrix(times(x, s.r), times(cross(z, x), s.r), times(z, s.r), s.a));
    } else if (s.k === "ellipsoid") solid(path, "ball", s.c, matrix(s.b.slice(0, 3), s.b.slice(3, 6), s.b.slice(6), s.a), 0.3);
    else if (s.k === "foot") solid(path, "foot", s.c, matrix([s.r, 0, 0], [0, 0, s.r], [0, -s.r, 0], add(s.a, [0, 0, -0.7 * s.r])));
    else solid(path, s.k, s.c, at(s.r));
  });
  function flexible(path, colour) { for (const part of ["rod", "head", "tail"]) solid(`${path}/${part}`, part === "rod" ? "rod" : "head", colour, null); }
  data.arrows.forEach((one, n) => flexible(`/${one.g}/${n}`, one.c));
  data.holds.forEach((one, n) => { flexible(`/${one.g}/${n}`, one.c); solid(`/${one.g}/${n}/ring`, "ring", one.c, null); });

  // ---- a moment of the motion
  const last = data.t.length - 1;
  let now = 0, poses = [];
  function between(k) {
    const i = Math.min(Math.floor(k), last), j = Math.min(i + 1, last), s = k - i, a = data.poses[i], b = data.poses[j];
    const mixed = [];
    for (let o = 0; o < a.length; o += 7) {
      const p = a.slice(o, o + 7), q = b.slice(o, o + 7), sign = dot(p.slice(3), q.slice(3)) < 0 ? -1 : 1;
      mixed.push([...add(times(p.slice(0, 3), 1 - s), q.slice(0, 3), s), ...unit(add(times(p.slice(3), 1 - s), q.slice(3), s * sign))]);
    }
    return mixed.map(placed);
  }
  function stretch(path, a, b, both, thick) {
    const long = size(add(b, a, -1)), e = unit(add(b, a, -1)), tip = Math.min(5 * thick, 0.4 * long);
    show(path, long > 0.004);
    send("set_transform", `${path}/rod`, {matrix: along(add(a, e, both === 1 ? tip : 0), add(b, e, -tip), thick)});
    send("set_transform", `${path}/head`, {matrix: along(add(b, e, -tip), b, 0.42 * tip)});
    const back = both === 2 ? add(b, e, -2 * tip) : add(a, e, tip), end = both === 2 ? add(b, e, -tip) : a;
    send("set_transform", `${path}/tail`, {matrix: along(back, end, 0.42 * tip)});
    show(`${path}/tail`, both > 0);
  }
  function draw(k) {
    now = k;
    poses = between(k);
    poses.forEach((m, i) => send("set_transform", `/b${i}`, {matrix: m}));
    for (const [path, s] of slides) send("set_transform", path, {matrix: along(moved(poses[s.i], s.a), moved(poses[s.j], s.b), s.r)});
    const i = Math.round(k);
    data.arrows.forEach((one, n) => {
      const o = 3 * (one.v.length > 3 ? i : 0), a = moved(poses[one.i], one.p);
      stretch(`/${one.g}/${n}`, a, add(a, one.v.slice(o, o + 3)), one.m ? 2 : 0, one.g === "actuators" ? 0.016 : 0.008);
    });
    const key = data.keys.reduce((best, x, n) => (Math.abs(x - k) < Math.abs(data.keys[best] - k) ? n : best), 0);
    data.holds.forEach((one, n) => {
      const path = `/${one.g}/${n}`, [px, py, pz, dx, dy, dz, kind] = one.w.slice(7 * key, 7 * key + 7);
      const p = [px, py, pz], d = [dx, dy, dz], line = kind === (one.g === "freedoms" ? 1 : 0);
      stretch(path, add(p, d, -0.22), add(p, d, 0.22), 1, 0.006);
      show(path, kind >= 0);
      for (const part of ["head", "tail"]) show(`${path}/${part}`, line || kind === 2);
      const x = unit(cross(d, Math.abs(dz) < 0.9 ? [0, 0, 1] : [1, 0, 0])), r = 0.045;
      send("set_transform", `${path}/ring`, {matrix: matrix(times(x, r), times(cross(d, x), r), times(d, r), add(p, d, 0.12))});
      show(`${path}/ring`, !line);
    });
    const y = Object.entries(data.y).map(([name, v], n) => `${name} = ${v[i].toFixed(3)} ${data.units[n]}`);
    said.textContent = [last ? `t = ${data.t[i].toFixed(3)} s` : "home pose", ...y.slice(0, 6)].join("   ");
    slider.value = i;
    slider.setAttribute("aria-valuetext", said.textContent);
  }

  // ---- what steers it
  function make(tag, properties = {}, ...inside) {
    const made = Object.assign(document.createElement(tag), properties);
    made.append(...inside);
    return made;
  }
  const slider = make("input", {type: "range", min: 0, max: last, step: 1, value: 0, oninput: () => { stop(); draw(+slider.value); }});
  slider.setAttribute("aria-label", "time");
  slider.style.cssText = "flex:1 1 10em;min-width:6em";
  const said = make("output"), button = make("button", {type: "button", textContent: "▶ play", onclick: () => (timer ? stop() : play())});
  said.style.cssText = "font-variant-numeric:tabular-nums;white-space:pre-wrap";
  let timer = 0;
  function stop() { cancelAnimationFrame(timer); timer = 0; button.textContent = "▶ play"; }
  function play() {
    const whole = 1000 * Math.min(Math.max(data.t[last] - data.t[0], 3), 12), since = performance.now() - (now >= last ? 0 : (now / last) * whole);
    const step = time => { draw(Math.min(((time - since) / whole) * last, last)); now < last ? (timer = requestAnimationFrame(step)) : stop(); };
    button.textContent = "❚❚ pause";
    timer = requestAnimationFrame(step);
  }
  const bar = make("div", {}, button, slider, said), boxes = make("div");
  bar.style.cssText = boxes.style.cssText = "display:flex;flex-wrap:wrap;gap:.3em 1em;align-items:center;margin:.3em 0";
  if (last) wrap.append(bar);
  else wrap.append(said);
  wrap.append(boxes);
  const overlay = make("div");
  overlay.style.cssText = "position:absolute;inset:0;pointer-events:none;font-size:12px;overflow:hidden";
  pane.append(overlay);
  const marks = data.shapes.filter((s, n) => (s.g === "joints" || s.g === "links") && n === data.shapes.findIndex(o => o.g === s.g && o.n === s.n));
  const toggles = {
    names: ["names", marks.length <= 20], axes: ["joint axes", true], frames: ["frames", false], masses: ["centres of mass", false], ellipsoids: ["inertia ellipsoids", false],
    doubts: ["suspicious", true], other: ["the other", true], loads: ["loads", true], actuators: ["actuator forces", true], reactions: ["reactions", false], wrenches: ["wrenches of the legs", false], freedoms: ["twists left", false],
  };
  const there = new Set([...groups, "names", ...data.arrows.map(a => a.g), ...data.holds.map(h => h.g)]);
  for (const [group, [text, on]] of Object.entries(toggles)) {
    if (!there.has(group)) continue;
    const set = value => {
      if (group === "names") overlay.hidden = !value;
      else if (groups.has(group)) data.bodies.forEach((_, i) => show(`/b${i}/${group}`, value));
      else show(`/${group}`, value);
    };
    const box = make("input", {type: "checkbox", checked: on, name: group, onchange: () => set(box.checked)});
    boxes.append(make("label", {}, box, ` ${text}${data.scales[group] ? ` (${data.scales[group]})` : ""}`));
    set(on);
  }
  const key = make("div", {}, "orange: driven (ring or arrows); cage: cut, closes a loop; grey foot: ground");
  key.style.cssText = "font-size:.85em;opacity:.8";
  wrap.append(key);

  // ---- names, where the camera sees what they name
  const names = marks.map(s => {
    const label = make("span", {textContent: s.n});
    label.style.cssText = `position:absolute;left:0;top:0;white-space:nowrap;${s.g === "links" ? "font-style:italic;opacity:.75" : ""}`;
    overlay.append(label);
    return [label, s];
  });
  const render = viewer.render.bind(viewer);
  viewer.render = () => {
    render();
    if (overlay.hidden) return;
    const V = viewer.camera.matrixWorldInverse.elements, P = viewer.camera.projectionMatrix.elements;
    for (const [label, s] of names) {
      const [x, y, z] = moved(poses[s.i] || placed([0, 0, 0, 0, 0, 0, 1]), s.k === "ball" || s.k === "slide" ? s.a : times(add(s.a, s.b), 0.5));
      const p = moved(V, [x, z, -y]), w = -p[2]; // three.js has y up
      label.style.transform = `translate(${((P[0] * p[0]) / w + 1) * 0.5 * pane.clientWidth + 8}px,${(1 - (P[5] * p[1]) / w) * 0.5 * pane.clientHeight - 7}px)`;
    }
  };

  // ---- the camera: as near as all joints and bodies stay within the picture, names and all
  const points = [];
  for (let k = 0; k <= last; k += Math.max(1, Math.round(last / 20))) {
    const at = between(k);
    for (const s of data.shapes) if (["links", "joints", "other"].includes(s.g) && s.k !== "slide") for (const p of [s.a, s.b]) points.push(moved(at[s.i], p));
  }
  const middle = [0, 1, 2].map(i => (Math.min(...points.map(p => p[i])) + Math.max(...points.map(p => p[i]))) / 2);
  const camera = viewer.camera, controls = viewer.controls, aspect = pane.clientWidth / pane.clientHeight || 1;
  const d = unit(data.view), right = unit(cross(Math.abs(d[2]) < 0.99 ? [0, 0, 1] : [0, 1, 0], d)), up = cross(d, right), slope = Math.tan(Math.PI / 12);
  const far = Math.max(0.3, ...points.map(p => add(p, middle, -1)).map(p =>
    dot(p, d) + Math.max((Math.abs(dot(p, right)) + 0.12) / aspect, Math.abs(dot(p, up)) + 0.06) / slope));
  const eye = add(middle, d, far);
  camera.fov = 30;
  camera.position.set(eye[0], eye[2], -eye[1]);
  controls.target.set(middle[0], middle[2], -middle[1]);
  controls.enableZoom = false; // scrolling belongs to the page until somebody works here
  pane.addEventListener("pointerdown", () => (controls.enableZoom = true));
  pane.addEventListener("pointerleave", () => (controls.enableZoom = false));
  pane.style.touchAction = "pan-y";
  draw(0);
  viewer.set_3d_pane_size();
  return {draw, play, stop, viewer};
}
window.screwgaugeStage = screwgaugeStage;
