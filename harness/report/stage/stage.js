"use strict";
/* The mechanism in space, drawn by three.js. `data` is written by stage/picture.py: lengths as multiples of the
   mechanism's length, z up. Returns {draw, play, stop, viewer}; throws where there is no WebGL, before anything is
   added to the element. */
function screwgaugeStage(element, data) {
  const renderer = new THREE.WebGLRenderer({antialias: true, alpha: true});
  const {Group, Matrix4, Mesh, Quaternion, Vector3} = THREE;

  // ---- vectors
  const vector = (values, i = 0) => new Vector3(values[i], values[i + 1], values[i + 2]);
  const add = (a, b, factor = 1) => a.clone().addScaledVector(b, factor);
  const scaled = (a, factor) => a.clone().multiplyScalar(factor);
  const direction = (a, b) => add(b, a, -1).normalize();
  const normalTo = a => a.clone().cross(vector(Math.abs(a.z) < 0.9 ? [0, 0, 1] : [1, 0, 0])).normalize();

  // ---- solids of unit size, stretched and placed by their matrices
  const SOLIDS = {
    rod: new THREE.CylinderGeometry(1, 1, 1, 20),
    head: new THREE.CylinderGeometry(0, 1, 1, 20),
    box: new THREE.BoxGeometry(2, 1, 2),
    ball: new THREE.SphereGeometry(1, 24, 16),
    cage: new THREE.SphereGeometry(1, 8, 6),
    ring: new THREE.TorusGeometry(1, 0.16, 10, 36),
    foot: new THREE.CylinderGeometry(0.35, 1, 0.8, 4).rotateX(Math.PI / 2),
  };
  function solid(parent, kind, color, opacity = 1) {
    const wireframe = kind === "cage", transparent = opacity < 1;
    const material = new THREE.MeshPhongMaterial({color, opacity, transparent, wireframe, shininess: 25, depthWrite: !transparent});
    const mesh = new Mesh(SOLIDS[kind], material);
    mesh.matrixAutoUpdate = false;
    parent.add(mesh);
    return mesh;
  }
  function place(mesh, x, y, z, position) {
    mesh.matrix.makeBasis(x, y, z).setPosition(position);
    mesh.matrixWorldNeedsUpdate = true;
  }
  const placeSized = (mesh, size, p) => place(mesh, vector([size, 0, 0]), vector([0, size, 0]), vector([0, 0, size]), p);
  function placeBetween(mesh, a, b, radius) { // a solid whose axis is y
    const y = direction(a, b), x = normalTo(y), long = Math.max(a.distanceTo(b), 1e-6);
    place(mesh, scaled(x, radius), scaled(y, long), scaled(x.clone().cross(y), radius), add(a, add(b, a, -1), 0.5));
  }
  function placeAround(mesh, axis, radius, p) { // a solid whose axis is z
    const x = normalTo(axis);
    place(mesh, scaled(x, radius), scaled(axis.clone().cross(x), radius), scaled(axis, radius), p);
  }

  // ---- the scene: a group for each body, within it one for all that is switched together
  const WORLD = -1, scene = new THREE.Scene(), bodies = data.bodies.map(() => new Group()), groups = {};
  function group(name, body) {
    const made = ((groups[name] ||= {})[body] ||= new Group());
    (bodies[body] || scene).add(made);
    return made;
  }
  const slides = []; // rods between two bodies
  for (const shape of data.shapes) {
    const {k: kind, r: size, c: colour} = shape, a = vector(shape.a), b = vector(shape.b);
    const parent = group(shape.g, kind === "slide" ? WORLD : shape.i);
    if (kind === "slide") slides.push([solid(parent, "rod", colour), shape, a, b]);
    else if (kind === "rod" || kind === "box") {
      placeBetween(solid(parent, kind, colour), a, b, size);
      if (shape.g === "links") for (const end of [a, b]) placeSized(solid(parent, "ball", colour), size, end);
    } else if (kind === "arrow") {
      const neck = add(b, direction(a, b), -5 * size);
      placeBetween(solid(parent, "rod", colour), a, neck, size);
      placeBetween(solid(parent, "head", colour), neck, b, 2.4 * size);
    } else if (kind === "ring") placeAround(solid(parent, "ring", colour), direction(a, b), size, a);
    else if (kind === "ellipsoid") place(solid(parent, "ball", colour, 0.3), b, vector(shape.b, 3), vector(shape.b, 6), a);
    else placeSized(solid(parent, kind, colour), size, kind === "foot" ? add(a, vector([0, 0, -0.7 * size])) : a);
  }
  function stretchable(one) { // an arrow, or one with two heads, that is drawn anew at each moment
    const whole = new Group();
    group(one.g, WORLD).add(whole);
    return {whole, rod: solid(whole, "rod", one.c), head: solid(whole, "head", one.c), tail: solid(whole, "head", one.c)};
  }
  const arrows = data.arrows.map(one => ({one, parts: stretchable(one), foot: vector(one.p)}));
  const screws = data.holds.map(one => {
    const parts = stretchable(one);
    return {one, parts, ring: solid(parts.whole, "ring", one.c)};
  });

  // ---- one moment of the motion
  const last = data.t.length - 1;
  let now = 0, requested = 0; // the sample that is shown; the frame that is asked for
  function pose(k) { // k: number of the sample, also between two
    const i = Math.min(Math.floor(k), last), from = data.poses[i], to = data.poses[Math.min(i + 1, last)];
    const rotation = (values, o) => new Quaternion(values[o + 4], values[o + 5], values[o + 6], values[o + 3]);
    bodies.forEach((body, n) => {
      body.position.copy(vector(from, 7 * n)).lerp(vector(to, 7 * n), k - i);
      body.quaternion.copy(rotation(from, 7 * n)).slerp(rotation(to, 7 * n), k - i);
      body.updateMatrixWorld();
    });
  }
  const inWorld = (body, point) => (bodies[body] ? point.clone().applyMatrix4(bodies[body].matrixWorld) : point);
  function stretch({whole, rod, head, tail}, a, b, heads, thick) { // heads: "one", "two" (both ends) or "double" (a moment)
    const long = a.distanceTo(b), e = direction(a, b), tip = Math.min(5 * thick, 0.4 * long), neck = add(b, e, -tip);
    whole.visible = long > 0.004;
    placeBetween(rod, add(a, e, heads === "two" ? tip : 0), neck, thick);
    placeBetween(head, neck, b, 0.42 * tip);
    if (heads === "double") placeBetween(tail, add(neck, e, -tip), neck, 0.42 * tip);
    else placeBetween(tail, add(a, e, tip), a, 0.42 * tip);
    tail.visible = heads !== "one";
  }
  function drawArrows(i) {
    for (const {one, parts, foot} of arrows) {
      const a = inWorld(one.i, foot), force = vector(one.v, one.v.length > 3 ? 3 * i : 0);
      stretch(parts, a, add(a, force), one.m ? "double" : "one", one.g === "actuators" ? 0.016 : 0.008);
    }
  }
  function drawScrews(k) { // at the nearest sample at which they were computed
    const nearest = data.keys.reduce((best, key, n) => (Math.abs(key - k) < Math.abs(data.keys[best] - k) ? n : best), 0);
    for (const {one, parts, ring} of screws) {
      const p = vector(one.w, 7 * nearest), d = vector(one.w, 7 * nearest + 3), kind = one.w[7 * nearest + 6];
      const straight = kind === (one.g === "freedoms" ? 1 : 0); // a force, a translation: no ring
      stretch(parts, add(p, d, -0.22), add(p, d, 0.22), "two", 0.006);
      parts.whole.visible = kind >= 0;
      parts.head.visible = parts.tail.visible = straight || kind === 2;
      placeAround(ring, d, 0.045, add(p, d, 0.12));
      ring.visible = !straight;
    }
  }
  function draw(k) {
    now = k;
    pose(k);
    for (const [mesh, shape, a, b] of slides) placeBetween(mesh, inWorld(shape.i, a), inWorld(shape.j, b), shape.r);
    const i = Math.round(k);
    drawArrows(i);
    drawScrews(k);
    const y = Object.entries(data.y).map(([name, values], n) => `${name} = ${values[i].toFixed(3)} ${data.units[n]}`);
    readout.textContent = [last ? `t = ${data.t[i].toFixed(3)} s` : "home pose", ...y.slice(0, 6)].join("   ");
    slider.value = i;
    slider.setAttribute("aria-valuetext", readout.textContent);
    requestRender();
  }

  // ---- controls under the picture
  function make(tag, properties = {}, style = "", ...inside) {
    const made = Object.assign(document.createElement(tag), properties);
    made.style.cssText = style;
    made.append(...inside);
    return made;
  }
  const ROW = "display:flex;flex-wrap:wrap;gap:.3em 1em;align-items:center;margin:.3em 0";
  const PANE = "position:relative;min-height:260px;overflow:hidden;outline-offset:-2px;touch-action:pan-y;cursor:grab";
  const pane = make("div", {tabIndex: 0}, `${PANE};height:min(62vh,${element.clientWidth < 600 ? 340 : 480}px)`);
  pane.setAttribute("role", "img");
  pane.setAttribute("aria-label", `${data.title} in space; drag or use the arrow keys to turn, after a click scroll to zoom`);
  const scrub = () => { stop(); draw(+slider.value); };
  const slider = make("input", {type: "range", min: 0, max: last, step: 1, value: 0, oninput: scrub}, "flex:1 1 10em;min-width:6em");
  slider.setAttribute("aria-label", "time");
  const readout = make("output", {}, "font-variant-numeric:tabular-nums;white-space:pre-wrap");
  const button = make("button", {type: "button", textContent: "▶ play", onclick: () => (timer ? stop() : play())});
  let timer = 0;
  function stop() {
    cancelAnimationFrame(timer);
    timer = 0;
    button.textContent = "▶ play";
  }
  function play() { // in real time, but 3 to 12 seconds long
    const duration = 1000 * Math.min(Math.max(data.t[last] - data.t[0], 3), 12);
    const start = performance.now() - (now >= last ? 0 : (now / last) * duration);
    const step = time => {
      draw(Math.min((Math.max(time - start, 0) / duration) * last, last));
      if (now < last) timer = requestAnimationFrame(step);
      else stop();
    };
    button.textContent = "❚❚ pause";
    timer = requestAnimationFrame(step);
  }

  const overlay = make("div", {}, "position:absolute;inset:0;pointer-events:none;font-size:12px;overflow:hidden");
  const isFirst = (shape, n) => n === data.shapes.findIndex(other => other.g === shape.g && other.n === shape.n);
  const named = data.shapes.filter((shape, n) => ["joints", "springs", "links"].includes(shape.g) && isFirst(shape, n));
  const LAYERS = { // group: label, shown at first
    names: ["names", named.length <= 20],
    axes: ["joint axes", true],
    frames: ["frames", false],
    masses: ["centres of mass", false],
    ellipsoids: ["inertia ellipsoids", false],
    doubts: ["warnings", true],
    springs: ["springs", true],
    other: ["second model", true],
    loads: ["loads", true],
    actuators: ["actuator forces", true],
    reactions: ["reactions", false],
    wrenches: ["constraint wrenches", false],
    freedoms: ["remaining freedoms", false],
  };
  const swatch = colour => make("span", {}, `display:inline-block;width:.8em;height:.8em;border-radius:2px;margin-right:.35em;background:${colour}`);
  const boxes = make("div", {}, ROW);
  for (const [name, [label, shown]] of Object.entries(LAYERS)) {
    const parts = Object.values(groups[name] || {});
    const show = visible => {
      if (name === "names") overlay.hidden = !visible;
      for (const part of parts) part.visible = visible;
      requestRender();
    };
    if (name !== "names" && !parts.length) continue;
    const box = make("input", {type: "checkbox", checked: shown, name, onchange: () => show(box.checked)});
    const colour = data.tones[name] ? [" ", swatch(data.tones[name])] : [" "];
    boxes.append(make("label", {}, "", box, ...colour, `${label}${data.scales[name] ? ` (${data.scales[name]})` : ""}`));
    show(shown);
  }
  const legend = make("div", {}, `${ROW};font-size:.85em`, ...data.legend.map(([colour, text]) => make("span", {}, "", swatch(colour), text)));
  const labels = named.map(shape => {
    const halo = "text-shadow:0 0 3px var(--paper),0 0 3px var(--paper),0 0 2px var(--paper)";
    const style = `position:absolute;left:0;top:0;white-space:nowrap;${halo};${shape.g === "links" ? `font-style:italic;color:${shape.c}` : ""}`;
    const text = make("span", {textContent: shape.n, className: shape.g}, style), a = vector(shape.a);
    overlay.append(text);
    return {text, mark: shape.g === "joints", body: shape.i, at: shape.k === "ball" || shape.k === "slide" ? a : a.lerp(vector(shape.b), 0.5)};
  });
  renderer.domElement.style.display = "block";
  const corner = document.createElementNS("http://www.w3.org/2000/svg", "svg");
  corner.setAttribute("class", "links"); // as bright as names in the dark
  corner.setAttribute("style", "position:absolute;inset:0;width:100%;height:100%;pointer-events:none;font-size:12px");
  pane.append(renderer.domElement, overlay, corner);
  const bar = last ? make("div", {}, ROW, button, slider, readout) : readout;
  element.append(make("div", {className: "stage"}, "", pane, bar, boxes, legend));

  // ---- camera and light
  const camera = new THREE.PerspectiveCamera(30, 1, 0.01, 100), lamp = new THREE.DirectionalLight(0xffffff, 0.6);
  const target = new Vector3(), slope = Math.tan(Math.PI / 12); // of half the angle of view
  camera.up.set(0, 0, 1);
  lamp.position.set(0.4, 0.8, 0);
  camera.add(lamp);
  scene.add(camera, new THREE.HemisphereLight(0xffffff, 0xb0b0b0, 0.75), ...bodies);
  function requestRender() { requested ||= requestAnimationFrame(render); }
  function render() {
    requested = 0;
    renderer.render(scene, camera);
    drawCorner();
    const spots = (overlay.hidden ? [] : labels).map(label => {
      const {x, y} = inWorld(label.body, label.at).clone().project(camera);
      return [label, (x + 1) * 0.5 * pane.clientWidth, (1 - y) * 0.5 * pane.clientHeight];
    });
    const marks = spots.filter(([label]) => label.mark); // joints stay free
    const taken = marks.map(([, x, y]) => ({left: x - 7, right: x + 7, top: y - 5, bottom: y + 5}));
    const foot = pane.clientHeight; // world axes and scale bar
    taken.push({left: 0, right: 78, top: foot - 70, bottom: foot}, {left: 84, right: 206, top: foot - 34, bottom: foot});
    for (const [label, x, y] of spots) placeLabel(label, x, y, taken);
  }
  const SPOTS = [[10, -13], [10, 13], [-10, -13], [-10, 13], [14, 0], [-14, 0], [12, -28], [12, 28], [-12, -28], [-12, 28]];
  function placeLabel(label, x, y, taken) { // where it last was if that is free, else at the first free spot, else nowhere
    label.width ||= label.text.offsetWidth;
    label.height ||= label.text.offsetHeight;
    const boxAt = ([dx, dy]) => {
      const left = x + dx - (dx < 0 ? label.width : 0), top = y + dy - label.height / 2;
      return {left, top, right: left + label.width, bottom: top + label.height};
    };
    const isFree = one => one.left >= 0 && one.right <= pane.clientWidth && one.top >= 0 && taken.every(other =>
      one.right < other.left || one.left > other.right || one.bottom < other.top || one.top > other.bottom);
    label.spot = [label.spot || SPOTS[0], ...SPOTS].find(spot => isFree(boxAt(spot)));
    label.text.style.visibility = label.spot ? "" : "hidden";
    if (!label.spot) return;
    const box = boxAt(label.spot);
    taken.push(box);
    label.text.style.transform = `translate(${box.left}px,${box.top}px)`;
  }
  function drawCorner() { // world axes, and a bar of a round length, true in the middle of the picture
    const turn = camera.quaternion.clone().conjugate(), parts = [], tall = pane.clientHeight;
    if (!tall) return; // on paper, or within a closed fold
    ["x", "y", "z"].forEach((name, i) => {
      const way = vector([i === 0, i === 1, i === 2].map(Number)).applyQuaternion(turn), flat = Math.hypot(way.x, way.y) < 0.2;
      const [tx, ty] = flat ? [24, -22 + tall] : [34 + 31 * way.x, tall - 30 - 31 * way.y];
      const shape = flat
        ? `<circle cx="34" cy="${tall - 30}" r="4"/><circle cx="34" cy="${tall - 30}" r="${way.z > 0 ? 1 : 0}"/>`
        : `<path d="M34,${tall - 30}l${22 * way.x},${-22 * way.y}"/>`;
      parts.push(`<g stroke="${data.world[i]}" stroke-width="2" fill="none">${shape}</g>`);
      parts.push(`<text x="${tx}" y="${ty + 4}" fill="${data.world[i]}" text-anchor="middle">${name}</text>`);
    });
    const pixels = tall / (2 * slope * eye().length() * data.unit); // of a metre
    const power = 10 ** Math.floor(Math.log10(110 / pixels));
    const long = power * Math.max(...[1, 2, 5].filter(step => step * power * pixels <= 110.001));
    const said = long < 0.1 ? `${+(1e3 * long).toPrecision(6)} mm` : `${+long.toPrecision(6)} m`;
    parts.push(`<path d="M90,${tall - 16}v-6v6h${long * pixels}v-6" stroke="currentColor" stroke-width="1.5" fill="none"/>`);
    parts.push(`<text x="96" y="${tall - 21}" fill="currentColor">${said}</text>`);
    corner.innerHTML = parts.join("");
  }
  function resize() {
    if (!pane.clientWidth) return; // within a closed fold
    camera.aspect = pane.clientWidth / pane.clientHeight;
    camera.updateProjectionMatrix();
    renderer.setPixelRatio(devicePixelRatio);
    renderer.setSize(pane.clientWidth, pane.clientHeight);
    render();
  }
  function look(eye) { // from a point relative to the target
    camera.position.copy(target).add(eye);
    camera.lookAt(target);
    camera.updateMatrixWorld();
    requestRender();
  }
  function lookAtAll() { // as near as all joints and bodies stay within the picture, names and all
    const points = [];
    for (let k = 0; k <= last; k += Math.max(1, Math.round(last / 20))) {
      pose(k);
      for (const shape of data.shapes)
        if (shape.g === "springs" || (["links", "joints", "axes", "other"].includes(shape.g) && shape.k !== "slide"))
          points.push(inWorld(shape.i, vector(shape.a)), inWorld(shape.k === "slide" ? shape.j : shape.i, vector(shape.b)));
    }
    new THREE.Box3().setFromPoints(points).getCenter(target);
    const back = vector(data.view).normalize(), aspect = pane.clientWidth / pane.clientHeight || 1;
    const right = vector(Math.abs(back.z) < 0.99 ? [0, 0, 1] : [0, 1, 0]).cross(back).normalize(), up = back.clone().cross(right);
    const below = pane.clientWidth < 500 ? 1 - 112 / (pane.clientHeight || 340) : 1; // of the lower half: axes are under it
    const distances = points.map(point => add(point, target, -1)).map(p =>
      p.dot(back) + Math.max((Math.abs(p.dot(right)) + 0.12) / aspect, Math.max(p.dot(up), -p.dot(up) / below) + 0.06) / slope);
    if (Math.abs(back.z) > 0.99) back.set(0, -0.001, back.z); // so that x points to the right
    look(scaled(back, Math.max(0.3, ...distances)));
  }

  // ---- dragging turns, with shift or the right button it moves; scrolling zooms once the picture was clicked
  const eye = () => add(camera.position, target, -1), zoom = factor => look(scaled(eye(), factor));
  const yUp = new Matrix4().makeRotationX(-Math.PI / 2), zUp = new Matrix4().makeRotationX(Math.PI / 2);
  function turn(around, over) {
    const at = new THREE.Spherical().setFromVector3(eye().applyMatrix4(yUp)); // which takes y to be up
    at.theta += around;
    at.phi = Math.min(Math.max(at.phi + over, 0.01), Math.PI - 0.01);
    look(new Vector3().setFromSpherical(at).applyMatrix4(zUp));
  }
  function shift(dx, dy) { // in heights of the picture
    const from = eye(), height = 2 * slope * from.length();
    target.add(vector([-dx * height, dy * height, 0]).applyQuaternion(camera.quaternion));
    look(from);
  }
  const held = new Map(); // pointers that are down: two of them pinch
  let zooms = false;
  pane.addEventListener("pointerdown", event => {
    zooms = true;
    held.set(event.pointerId, event);
    pane.setPointerCapture(event.pointerId);
  });
  for (const end of ["pointerup", "pointercancel"]) pane.addEventListener(end, event => held.delete(event.pointerId));
  pane.addEventListener("pointerleave", () => (zooms = false));
  pane.addEventListener("contextmenu", event => event.preventDefault());
  pane.addEventListener("wheel", event => {
    if (!zooms) return;
    event.preventDefault();
    zoom(1.001 ** event.deltaY);
  }, {passive: false});
  pane.addEventListener("pointermove", event => {
    const before = held.get(event.pointerId);
    if (!before) return;
    held.set(event.pointerId, event);
    const dx = (event.clientX - before.clientX) / pane.clientHeight, dy = (event.clientY - before.clientY) / pane.clientHeight;
    const second = [...held.values()].find(other => other.pointerId !== event.pointerId);
    const gap = one => Math.hypot(one.clientX - second.clientX, one.clientY - second.clientY);
    if (second) zoom(gap(before) / gap(event));
    else if (event.shiftKey || event.buttons === 2) shift(dx, dy);
    else turn(-2 * Math.PI * dx, -2 * Math.PI * dy);
  });
  pane.addEventListener("keydown", event => {
    const step = {ArrowLeft: [0.1, 0], ArrowRight: [-0.1, 0], ArrowUp: [0, 0.1], ArrowDown: [0, -0.1]}[event.key];
    const factor = {"+": 0.9, "-": 1 / 0.9}[event.key];
    if (step) turn(...step);
    if (factor) zoom(factor);
    if (step || factor) event.preventDefault();
  });

  lookAtAll();
  new ResizeObserver(resize).observe(pane);
  draw(0);
  resize();
  return {draw, play, stop, viewer: {render, renderer}};
}
window.screwgaugeStage = screwgaugeStage;
