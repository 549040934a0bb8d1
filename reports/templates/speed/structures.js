"use strict";
// The 3-D look into the structures, and the walk of one ray, step by step.
// Files of the page's folder call structureFile(name, data); see reports/trials/inside.py.
(() => {
  const look = document.getElementById("look");
  const part = (name) => document.querySelector(`[data-part=${name}]`);
  const setup = JSON.parse(look.dataset.setup); // files, titles, totals
  const canvas = part("view");
  const state = { name: "bvh", depth: 3, ray: 0, step: 0, yaw: 0.5, pitch: 0.35, zoom: 1 };
  let turning = !matchMedia("(prefers-reduced-motion: reduce)").matches;
  let playing = 0;
  let scene = null;
  const loaded = {};

  // ------------------------------------------------------------------ files and numbers
  const unpack = (text, Kind) =>
    new Kind(Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0)).buffer);
  const points = (text) =>
    Float32Array.from(unpack(text, Uint16Array), (v, k) =>
      scene.low[k % 3] + (v / 65535) * scene.size);

  window.structureFile = (name, data) => {
    if (name === "scene") {
      scene = data;
      scene.points = points(data.vertices);
      scene.triangles = unpack(data.faces, Uint16Array);
      [scene.min, scene.max] = [Math.min, Math.max].map((least) =>
        [0, 1, 2].map((axis) =>
          scene.points.reduce((a, v, k) => (k % 3 === axis ? least(a, v) : a), scene.points[axis])));
      scene.centre = scene.min.map((v, k) => (v + scene.max[k]) / 2);
      scene.radius = Math.hypot(...scene.max.map((v, k) => v - scene.min[k])) / 2;
      load(state.name);
      return;
    }
    data.boxes = points(data.boxes);
    data.level = unpack(data.level, Uint8Array);
    data.held = unpack(data.held, Uint16Array);
    data.leaf = unpack(data.leaf, Uint8Array);
    if (data.edges) {
      data.edges = points(data.edges);
      data.edgeStart = unpack(data.edgeStart, Uint32Array);
    }
    loaded[name] = data;
    if (name === state.name) show();
  };

  function load(name) {
    if (loaded[name]) return show();
    const script = document.createElement("script");
    script.src = setup.files[name];
    script.onerror = () => { part("said").textContent = `${script.src} is missing.`; };
    document.head.append(script);
  }

  // ------------------------------------------------------------------------ what is drawn
  // Vertices are 7 numbers: x y z, r g b a.
  const dark = () => matchMedia("(prefers-color-scheme: dark)").matches;
  const mix = (a, b, part) => a.map((v, k) => v + (b[k] - v) * part);
  const COLOURS = {
    few: [0.1, 0.55, 0.75], many: [0.9, 0.35, 0.1], empty: [0.5, 0.5, 0.5],
    now: [0.95, 0.62, 0.0], visited: [0.25, 0.5, 0.95], skipped: [0.85, 0.2, 0.3],
    tested: [0.95, 0.55, 0.1], hit: [0.1, 0.7, 0.3], ray: [0.8, 0.1, 0.5],
  };

  function boxEdges(data, k) {
    if (data.edges) return data.edges.subarray(6 * data.edgeStart[k], 6 * data.edgeStart[k + 1]);
    const b = data.boxes.subarray(6 * k, 6 * k + 6);
    const found = [];
    for (let axis = 0; axis < 3; axis++) {
      for (let side = 0; side < 4; side++) {
        const [u, v] = [(axis + 1) % 3, (axis + 2) % 3];
        for (const end of [0, 3]) {
          const p = [0, 0, 0];
          p[axis] = b[axis + end];
          p[u] = b[u + (side & 1 ? 3 : 0)];
          p[v] = b[v + (side & 2 ? 3 : 0)];
          found.push(...p);
        }
      }
    }
    return found;
  }
  function addLines(list, edges, colour, alpha) {
    for (let k = 0; k < edges.length; k += 3) {
      list.push(edges[k], edges[k + 1], edges[k + 2], ...colour, alpha);
    }
  }
  function addTriangle(list, k, colour, alpha) {
    const corner = [0, 1, 2].map((j) => {
      const at = 3 * scene.triangles[3 * k + j];
      return [scene.points[at], scene.points[at + 1], scene.points[at + 2]];
    });
    const [a, b] = [1, 2].map((j) => corner[j].map((v, i) => v - corner[0][i]));
    const n = [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
    const light = (0.4 * n[0] - 0.6 * n[1] + 0.7 * n[2]) / (Math.hypot(...n) || 1);
    const shade = 0.62 + 0.3 * light;
    for (const p of corner) list.push(...p, ...colour.map((c) => c * shade), alpha);
  }
  const drawnAt = (data, k) =>
    data.level[k] === state.depth || (data.leaf[k] && data.level[k] < state.depth);

  // Returns lists of vertices: triangles, thin lines, strong lines.
  function assemble() {
    const data = loaded[state.name];
    const lists = { triangles: [], thin: [], strong: [] };
    const steps = data.walks[state.ray].slice(0, state.step);
    const walking = steps.length > 0;
    const tested = new Map();
    const last = steps[steps.length - 1];
    for (const step of steps) for (const k of step[3]) tested.set(k, COLOURS.tested);
    if (walking && last[10] >= 0) tested.set(last[10], COLOURS.hit);
    const stone = dark() ? [0.62, 0.65, 0.7] : [0.78, 0.78, 0.76];
    // opaque ones first: what is drawn through them must lie behind
    for (const [k, colour] of tested) addTriangle(lists.triangles, k, colour, 1);
    for (let k = 0; k < scene.triangles.length / 3; k++) {
      if (!tested.has(k)) addTriangle(lists.triangles, k, stone, walking ? 0.25 : 1);
    }
    if (!walking) {
      const drawn = [...data.level.keys()].filter((k) => drawnAt(data, k));
      const full = drawn.map((k) => data.held[k]).filter((n) => n > 0);
      const [least, most] = [Math.min(...full), Math.max(...full)].map(Math.log);
      for (const k of drawn) {
        const many = most > least ? (Math.log(data.held[k]) - least) / (most - least) : 1;
        const colour = data.held[k] ? mix(COLOURS.few, COLOURS.many, many) : COLOURS.empty;
        addLines(lists.thin, boxEdges(data, k), colour, data.held[k] ? 0.9 : 0.25);
      }
      return lists;
    }
    for (const [, item, kind] of steps.slice(0, -1)) {
      if (item < 0) continue;
      const colour = kind === "skip" ? COLOURS.skipped : COLOURS.visited;
      addLines(lists.thin, boxEdges(data, item), colour, kind === "leaf" ? 0.9 : 0.45);
    }
    if (last[1] >= 0) {
      const colour = last[2] === "skip" ? COLOURS.skipped : COLOURS.now;
      addLines(lists.strong, boxEdges(data, last[1]), colour, 1);
    }
    const { origin, direction } = scene.rays[state.ray];
    const end = last[9] === null ? 4 * scene.radius : last[9];
    addLines(lists.strong, [...origin, ...origin.map((v, k) => v + end * direction[k])], COLOURS.ray, 1);
    return lists;
  }

  const drawer = structureDrawer(canvas, look.dataset.drawer);

  let due = false;
  function draw() {
    if (due) return;
    due = true;
    requestAnimationFrame(() => { due = false; drawNow(); });
  }
  function drawNow() {
    if (!scene || !loaded[state.name]) return;
    const scale = devicePixelRatio || 1;
    canvas.width = Math.round(canvas.clientWidth * scale);
    canvas.height = Math.round(canvas.clientHeight * scale);
    drawer.draw(viewMatrix(canvas, state, scene), state.step > 0);
    look.dataset.drawn = `${state.name} ${state.depth} ${state.ray} ${state.step}`;
  }

  // --------------------------------------------------------------------------- the panel
  const many = (n, noun) => `${n.toLocaleString("en")} ${noun}${n === 1 ? "" : "s"}`;

  function show() {
    const data = loaded[state.name];
    if (!scene || !data) return;
    state.depth = Math.min(state.depth, data.depth);
    const walk = data.walks[state.ray];
    state.step = Math.min(state.step, walk.length);
    drawer.fill(assemble());
    part("structure").value = state.name;
    part("ray").value = state.ray;
    part("about").textContent = setup.about[state.name];
    part("depth").max = data.depth;
    part("depth").value = state.depth;
    let shown = 0;
    for (let k = 0; k < data.level.length; k++) shown += drawnAt(data, k);
    part("cells").textContent = data.titles ? data.titles[state.depth]
      : `depth ${state.depth} of ${data.deepest}: ${many(shown, "cell")} drawn of ${data.cells.toLocaleString("en")}`;
    part("step").max = walk.length;
    part("step").value = state.step;
    part("place").textContent = `step ${state.step} of ${walk.length}`;
    const last = state.step ? walk[state.step - 1] : ["Press Next: the ray sets out.", -1, "", [], 0, 0, 0, 0, 0, null, -1];
    let said = last[0];
    if (state.step === walk.length) {
      said += last[10] >= 0 ? ` The nearest hit is triangle ${last[10]} at ${last[9].toFixed(2)}.`
        : state.name === "bounding-volumes" ? "" : " The ray hits nothing.";
    }
    part("said").textContent = said;
    last.slice(4, 9).forEach((value, k) => { part(`count${k}`).textContent = value.toLocaleString("en"); });
    part("play").textContent = playing ? "Pause" : "Play";
    totals();
    draw();
  }
  function totals() {
    const rows = Object.entries(setup.totals).map(([name, rays]) => [name, rays[state.ray]]);
    const most = Math.log(Math.max(...rows.map(([, n]) => n[0] + n[1] + n[2])));
    part("totals").replaceChildren(...rows.map(([name, [nodes, boxes, tests]]) => {
      const row = document.createElement("tr");
      if (name === state.name) row.className = "chosen";
      const length = (100 * Math.log(nodes + boxes + tests)) / most;
      row.innerHTML = `<th scope="row"><button type="button"></button></th><td class="num">${nodes}</td><td class="num">${boxes}</td>
        <td class="num">${tests.toLocaleString("en")}</td><td class="bar"><i style="width:${length.toFixed(1)}%"></i></td>`;
      const button = row.querySelector("button");
      button.textContent = name;
      button.title = setup.titles[name];
      button.onclick = () => change({ name, step: 0 });
      return row;
    }));
  }
  function change(values) {
    turning = false;
    Object.assign(state, values);
    load(state.name);
  }
  function stepBy(n) {
    const length = loaded[state.name] ? loaded[state.name].walks[state.ray].length : 0;
    change({ step: Math.max(0, Math.min(length, state.step + n)) });
    if (state.step === length) stop();
  }
  function stop() {
    clearInterval(playing);
    playing = 0;
    part("play").textContent = "Play";
  }

  part("structure").onchange = (event) => { stop(); change({ name: event.target.value, step: 0 }); };
  part("depth").oninput = (event) => { stop(); change({ depth: +event.target.value, step: 0 }); };
  part("ray").onchange = (event) => { stop(); change({ ray: +event.target.value, step: 0 }); };
  part("step").oninput = (event) => { stop(); change({ step: +event.target.value }); };
  part("next").onclick = () => { stop(); stepBy(1); };
  part("previous").onclick = () => { stop(); stepBy(-1); };
  part("play").onclick = () => {
    if (playing) return stop();
    playing = setInterval(() => stepBy(1), 600);
    const length = loaded[state.name].walks[state.ray].length;
    if (state.step === length) change({ step: 0 });
    stepBy(1);
  };

  // Drag, wheel, two fingers, arrow keys. Fingers that move up or down scroll the page.
  const fingers = new Map();
  canvas.onpointerdown = (event) => {
    turning = false;
    canvas.setPointerCapture(event.pointerId);
    fingers.set(event.pointerId, [event.clientX, event.clientY]);
  };
  canvas.onpointermove = (event) => {
    const before = fingers.get(event.pointerId);
    if (!before) return;
    const apart = () => {
      const [a, b] = [...fingers.values()];
      return Math.hypot(a[0] - b[0], a[1] - b[1]) || 1;
    };
    const old = fingers.size === 2 ? apart() : 0;
    fingers.set(event.pointerId, [event.clientX, event.clientY]);
    if (old) return turn(0, 0, apart() / old);
    turn((event.clientX - before[0]) * 0.008, (event.clientY - before[1]) * 0.008, 1);
  };
  canvas.onpointerup = canvas.onpointercancel = (event) => fingers.delete(event.pointerId);
  canvas.addEventListener("wheel", (event) => {
    if (!event.ctrlKey && document.activeElement !== canvas) return; // the page scrolls
    event.preventDefault();
    turn(0, 0, Math.exp(-event.deltaY * 0.002));
  }, { passive: false });
  canvas.onkeydown = (event) => {
    const way = { ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, -0.1], ArrowDown: [0, 0.1] }[event.key];
    if (!way) return;
    event.preventDefault();
    turn(...way, 1);
  };
  function turn(across, down, factor) {
    turning = false;
    state.yaw -= across;
    state.pitch = Math.max(-1.5, Math.min(1.5, state.pitch + down));
    state.zoom = Math.max(0.5, Math.min(12, state.zoom * factor));
    draw();
  }
  new ResizeObserver(draw).observe(canvas);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", show);
  // It turns by itself until it is touched, or the machine is too slow for it.
  let slow = 0, before = 0;
  function turnOn(now) {
    if (!turning || slow > 5) return;
    const { top, bottom } = canvas.getBoundingClientRect();
    if (bottom > 0 && top < innerHeight && loaded[state.name]) {
      if (before && now - before > 80) slow += 1;
      state.yaw += 0.005;
      drawNow();
    }
    before = now;
    requestAnimationFrame(turnOn);
  }
  requestAnimationFrame(turnOn);
  look.viewer = { state, change, turn, drawNow };
  load("scene");
})();
