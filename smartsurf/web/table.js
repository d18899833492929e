// The table and its objects in 3-D, with the legend, the inspection and the labels beside them: for the player of recordings
// and for the live page, which have the same elements.
import * as THREE from 'three';
import { cellPlaces, makeMechanisms } from 'mechanisms';

const byId = (id) => document.getElementById(id);

// ---- Colours
// At t in [0, 1], between a palette's equidistant samples: sRGB from 0 to 255.
function paletteColour(palette, t) {
  const at = Math.min(Math.max(t, 0), 1) * (palette.length - 1), i = Math.min(Math.floor(at), palette.length - 2);
  return palette[i].map((c, k) => c + (at - i) * (palette[i + 1][k] - c));
}
// From sRGB in [0, 1].
const colourFrom = (rgb) => new THREE.Color().setRGB(...rgb, THREE.SRGBColorSpace);
// At 256 equidistant values.
const colourTable = (rgbAt) => Array.from({ length: 256 }, (_, i) => colourFrom(rgbAt(i / 255)));
const valueIn = (table, t) => table[t > 0 ? Math.round(255 * Math.min(t, 1)) : 0];

// The text of a value among others that differ by up to `range`: four digits of the range, at least four of its own, and its whole
// part up to nine digits; with an exponent where that shortens ten characters or more.
export function numberText(value, range = 0) {
  if (!Number.isFinite(value)) return '–';
  if (Math.abs(value) <= 1e-9 * range) return '0';   // or what rounding has left
  const magnitude = (x) => Math.floor(Math.log10(Math.abs(x))), own = magnitude(value);
  const digits = Math.max(4, own < 9 ? own + 1 : 0, range > 0 ? own - magnitude(range) + 4 : 0);
  const rounded = Number(value.toPrecision(Math.min(digits, 15)));
  const [plain, short] = [String(rounded), rounded.toExponential()].map((text) => text.replace('e+', 'e'));
  return plain.length > 9 && short.length < plain.length ? short : plain;
}

export function makeRenderer() {
  const renderer = new THREE.WebGLRenderer({ canvas: byId('view'), antialias: true, stencil: true, preserveDrawingBuffer: true });
  renderer.setPixelRatio(window.devicePixelRatio);
  renderer.shadowMap.enabled = true;
  renderer.shadowMap.type = THREE.PCFSoftShadowMap;
  return renderer;
}

// `scene`: see SceneJson.h. `series`: by name, arrays of values with value(frame, i) and missing(frame, i), as the player unpacks
// them. `state`: of the page: view, dark, selected, shown.
export function makeTable(scene, series, renderer, state) {
  const world = new THREE.Scene();
  world.background = new THREE.Color(0xe4e7ec);

  const places = cellPlaces(scene);
  const there = places.filter((place) => place.mechanism >= 0);
  const edge = (axis, sign) => there.reduce((most, place) => Math.max(most, sign * place[axis]), -Infinity) * sign;
  const wide = edge('x', 1) - edge('x', -1) + scene.pitch, high = edge('y', 1) - edge('y', -1) + scene.pitch;
  const size = Math.max(wide, high);
  const middle = new THREE.Vector3((edge('x', 1) + edge('x', -1)) / 2, (edge('y', 1) + edge('y', -1)) / 2, scene.low);
  const camera = new THREE.PerspectiveCamera(30, 1, size / 100, size * 20);
  camera.up.set(0, 0, 1);
  const controls = new THREE.OrbitControls(camera, renderer.domElement);
  controls.maxPolarAngle = Math.PI / 2;

  // The vector from the target to the eye.
  const kViews = { top: [0, -0.001, 1], iso: [0, -0.766, 0.643], side: [0, -0.995, 0.1] };

  // Fits the table into the picture.
  function frameTable(view) {
    const tangent = Math.tan(camera.fov * Math.PI / 360);
    const away = new THREE.Vector3(...kViews[view]).normalize(), right = new THREE.Vector3(1, 0, 0);
    const up = new THREE.Vector3().crossVectors(away, right), centre = middle.clone();
    const top = scene.border ?? scene.high;
    centre.z = (top + base) / 2;
    let distance = 0;
    for (const x of [-wide / 2, wide / 2])
      for (const y of [-high / 2, high / 2])
        for (const z of [base - centre.z, top - centre.z]) {
          const corner = new THREE.Vector3(x, y, z), near = corner.dot(away);
          distance = Math.max(distance, near + 1.06 * Math.abs(corner.dot(right)) / (tangent * camera.aspect),
            near + 1.06 * Math.abs(corner.dot(up)) / tangent);
        }
    controls.target.copy(centre);
    camera.position.copy(centre).addScaledVector(away, distance);
    controls.update();
    state.view = view;
  }

  const sky = new THREE.HemisphereLight(0xdfe8f5, 0x8a8478, 1.6);
  world.add(sky);
  const sun = new THREE.DirectionalLight(0xfff4e2, 2.2);
  sun.position.copy(middle).add(new THREE.Vector3(-0.52, -0.3, 0.8).multiplyScalar(size * 1.5));
  sun.target.position.copy(middle);
  sun.castShadow = true;
  sun.shadow.mapSize.set(2048, 2048);
  sun.shadow.bias = -0.0006;
  sun.shadow.normalBias = 0.05 * scene.pitch;
  Object.assign(sun.shadow.camera, { left: -0.8 * size, right: 0.8 * size, top: 0.8 * size, bottom: -0.8 * size, near: 0.1, far: size * 4 });
  world.add(sun, sun.target);
  const ground = new THREE.Mesh(new THREE.PlaneGeometry(size * 12, size * 12), new THREE.MeshLambertMaterial({ color: 0xd9dce2 }));
  ground.position.copy(middle).setZ(scene.low - scene.length - 0.02 * size);
  ground.receiveShadow = true;
  world.add(ground);
  // Lines 10 cells apart. A texture, because its mipmaps fade with the distance.
  function gridTexture() {
    const picture = document.createElement('canvas').getContext('2d');
    picture.canvas.width = picture.canvas.height = 256;
    picture.fillStyle = '#fff';
    picture.fillRect(0, 126, 256, 4);
    picture.fillRect(126, 0, 4, 256);
    const texture = new THREE.CanvasTexture(picture.canvas);
    texture.wrapS = texture.wrapT = THREE.RepeatWrapping;
    texture.anisotropy = renderer.capabilities.getMaxAnisotropy();
    texture.repeat.setScalar(size * 12 / (10 * scene.pitch));
    return texture;
  }
  const grid = new THREE.Mesh(ground.geometry,
    new THREE.MeshBasicMaterial({ map: gridTexture(), color: 0x7d8794, transparent: true, opacity: 0.55, depthWrite: false }));
  grid.position.copy(ground.position).setZ(ground.position.z + 0.002 * size);
  world.add(grid);

  const darkness = window.matchMedia('(prefers-color-scheme: dark)');
  function setColours() {
    const dark = darkness.matches;
    state.dark = dark;
    world.background = new THREE.Color(dark ? 0x12161b : 0xe4e7ec);
    ground.material.color.set(dark ? 0x1b2027 : 0xd9dce2);
    sky.intensity = dark ? 1.2 : 1.6;
    state.shown = -1;   // redraws the plot
  }

  // ---- Pins: columns down to the table
  // Its top is at z = 0, 1 wide along x.
  function pinGeometry(hexagonal) {
    if (!hexagonal) return new THREE.BoxGeometry(1, 1, 1).translate(0, 0, -0.5);
    const prism = new THREE.CylinderGeometry(1 / Math.sqrt(3), 1 / Math.sqrt(3), 1, 6).toNonIndexed();
    prism.computeVertexNormals();
    return prism.rotateX(Math.PI / 2).translate(0, 0, -0.5);
  }
  const cells = scene.rows * scene.columns, base = scene.low - scene.length;
  // The offset in depth grows with the slope of a face: without it sides that are seen edge-on show through what is in front.
  const pins = new THREE.InstancedMesh(pinGeometry(scene.hexagonal),
    new THREE.MeshLambertMaterial({ polygonOffset: true, polygonOffsetFactor: 2 }), cells);
  pins.castShadow = pins.receiveShadow = true;
  pins.frustumCulled = false;
  world.add(pins);
  const matrix = new THREE.Matrix4(), scale = new THREE.Vector3();
  // The border of a rectangular grid with narrow gaps is four closed walls, and the gaps between its pins end at a dark
  // floor, so that the ground does not show through. Other layouts, and tables with empty cells, have neither.
  const border = colourFrom(scene.colours.border);
  const walls = [], kFullGrid = scene.narrowGaps && there.length === cells;
  function addWall(x, y, width, depth, outwards) {
    const wall = new THREE.Mesh(pins.geometry, new THREE.MeshLambertMaterial({ color: border }));
    wall.position.set(x, y, 0);
    wall.scale.set(width, depth, 1);
    wall.castShadow = wall.receiveShadow = true;
    world.add(wall);
    walls.push({ wall, outwards: new THREE.Vector3(...outwards, 0) });
  }
  if (kFullGrid && scene.border !== null) {
    const east = (scene.columns - 1) * scene.pitch, north = (scene.rows - 1) * scene.pitch;
    for (const sign of [-1, 1]) {
      addWall(middle.x, sign < 0 ? 0 : north, wide, scene.pitch, [0, sign]);
      addWall(sign < 0 ? 0 : east, middle.y, scene.pitch, high - 2 * scene.pitch, [sign, 0]);
    }
  }
  if (kFullGrid) {
    const floor = new THREE.Mesh(new THREE.PlaneGeometry(wide, high), new THREE.MeshBasicMaterial({ color: 0x33383f }));
    floor.position.copy(middle).setZ(base + 0.001 * size);
    world.add(floor);
  }

  // Walls that face the camera are drawn lower than they are, because they would hide what happens behind them.
  function setWalls() {
    const forward = camera.getWorldDirection(new THREE.Vector3());
    for (const { wall, outwards } of walls) {
      const top = outwards.dot(forward) < -0.3 ? scene.low + scene.looks.lowered_wall * (scene.border - scene.low) : scene.border;
      wall.position.z = top;
      wall.scale.z = Math.max(top - base, 0.01);
    }
  }

  const shownHeight = new Float32Array(cells).fill(NaN);
  const mechanisms = makeMechanisms(scene, series, world, (cell) => places[cell]);
  const nowhere = new THREE.Matrix4().makeScale(0, 0, 0);

  const heightOf = (frame, cell) => (series.height ? series.height.value(frame, cell) : scene.low);
  function setPins(frame, channel) {
    for (let cell = 0; cell < cells; ++cell) {
      const height = heightOf(frame, cell) - mechanisms.recess[cell];
      if (height !== shownHeight[cell]) {
        shownHeight[cell] = height;
        const place = places[cell], hidden = place.mechanism < 0 || (walls.length > 0 && places[cell].border);
        matrix.makeRotationZ(place.angle).scale(scale.set(scene.top[0], scene.top[scene.hexagonal ? 0 : 1], Math.max(height - base, 0.01)));
        matrix.setPosition(place.x, place.y, height);
        pins.setMatrixAt(cell, hidden ? nowhere : matrix);
        pins.instanceMatrix.needsUpdate = true;
      }
      pins.setColorAt(cell, colourOf(frame, cell, channel));
    }
    pins.instanceColor.needsUpdate = true;
  }

  const { lowest_pin: lowest, highest_pin: highest } = scene.colours, noValue = colourFrom(scene.colours.no_value);
  const valueColours = colourTable((t) => paletteColour(scene.palette, t).map((c) => c / 255));
  const heightColours = colourTable((t) => lowest.map((c, k) => c + (highest[k] - c) * Math.sqrt(t)));
  function colourOf(frame, cell, channel) {
    if (places[cell].border) return border;
    if (channel?.missing(frame, cell)) return noValue;
    if (channel) return valueIn(valueColours, (channel.value(frame, cell) - channel.low) / (channel.high - channel.low));
    const range = scene.high - scene.low;
    return valueIn(heightColours, range > 0 ? (heightOf(frame, cell) - scene.low) / range : 1);
  }

  // ---- Objects: one instanced mesh per shape
  function geometryOf(object) {
    switch (object.shape) {
      case 'sphere': return new THREE.SphereGeometry(1, 32, 20);
      case 'box': return new THREE.BoxGeometry(2, 2, 2);
      case 'cylinder': return new THREE.CylinderGeometry(1, 1, 2, 40).rotateX(Math.PI / 2);
      case 'capsule': return new THREE.CapsuleGeometry(object.radius, Math.max(object.height - 2 * object.radius, 0), 8, 24).rotateX(Math.PI / 2);
      case 'cone': return new THREE.ConeGeometry(1, 1, 40).rotateX(Math.PI / 2).translate(0, 0, 0.25);
    }
    if (!object.vertices) return new THREE.BoxGeometry(2, 2, 2);
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute('position', new THREE.Float32BufferAttribute(object.vertices, 3));
    geometry.setIndex(object.triangles);
    const flat = geometry.toNonIndexed();
    flat.computeVertexNormals();
    return flat;
  }
  function scaleOf(object) {
    if (object.shape === 'cone') return [object.radius, object.radius, object.height];
    if (object.shape === 'capsule' || object.vertices) return [1, 1, 1];
    return object.half;
  }
  // Stripes on round shapes show how they roll about any axis: one around the middle and one through both ends.
  function stripeTexture() {
    const picture = document.createElement('canvas').getContext('2d');
    picture.canvas.width = 256;
    picture.canvas.height = 128;
    picture.fillStyle = '#fff';
    picture.fillRect(0, 0, 256, 128);
    picture.fillStyle = '#7a7a7a';
    picture.fillRect(0, 60, 256, 8);
    for (const x of [0, 124, 252]) picture.fillRect(x, 0, x === 124 ? 8 : 4, 128);
    const texture = new THREE.CanvasTexture(picture.canvas);
    texture.anisotropy = renderer.capabilities.getMaxAnisotropy();
    return texture;
  }
  const stripes = stripeTexture(), kStriped = ['sphere', 'cylinder', 'capsule', 'cone'];
  let meshes = [];
  // Takes the place of the objects that were there.
  function buildObjects(objects) {
    for (const { mesh } of meshes) {
      world.remove(mesh);
      mesh.dispose();
    }
    scene.objects = objects;
    const kinds = new Map();
    objects.forEach((object, id) => {
      const key = object.shape === 'capsule' ? `capsule ${object.radius} ${object.height}` : object.vertices ? `solid ${id}` : object.shape;
      if (!kinds.has(key)) kinds.set(key, []);
      kinds.get(key).push(id);
    });
    meshes = [...kinds.values()].map((ids) => {
      const map = kStriped.includes(objects[ids[0]].shape) ? stripes : null;
      const mesh = new THREE.InstancedMesh(geometryOf(objects[ids[0]]),
        new THREE.MeshStandardMaterial({ roughness: 0.45, metalness: 0, map }), ids.length);
      ids.forEach((id, i) => mesh.setColorAt(i, new THREE.Color().setRGB(...objects[id].colour, THREE.SRGBColorSpace)));
      mesh.castShadow = mesh.receiveShadow = true;
      mesh.frustumCulled = false;
      world.add(mesh);
      return { mesh, ids };
    });
  }
  buildObjects(scene.objects);
  const centre = new THREE.Vector3(), turn = new THREE.Quaternion();

  function poseOf(frame, id) {
    const p = series.position;
    if (!p || p.missing(frame, 3 * id)) return false;
    centre.set(p.value(frame, 3 * id), p.value(frame, 3 * id + 1), p.value(frame, 3 * id + 2));
    const q = series.orientation;
    turn.set(q.value(frame, 4 * id), q.value(frame, 4 * id + 1), q.value(frame, 4 * id + 2), q.value(frame, 4 * id + 3)).normalize();
    return true;
  }

  function setObjects(frame) {
    for (const { mesh, ids } of meshes) {
      ids.forEach((id, i) => {
        if (poseOf(frame, id)) mesh.setMatrixAt(i, matrix.compose(centre, turn, scale.set(...scaleOf(scene.objects[id]))));
        else mesh.setMatrixAt(i, nowhere);
      });
      mesh.instanceMatrix.needsUpdate = true;
    }
  }

  // ---- Inspection: a click selects an object or a cell
  const caster = new THREE.Raycaster();
  function select(x, y) {
    camera.updateMatrixWorld();   // the camera may have moved since the last frame
    const area = byId('view').getBoundingClientRect();
    caster.setFromCamera(new THREE.Vector2(2 * (x - area.left) / area.width - 1, 1 - 2 * (y - area.top) / area.height), camera);
    for (const { mesh } of meshes) mesh.boundingSphere = null;   // the instances have moved
    pins.boundingSphere = null;
    const hit = caster.intersectObjects([pins, ...walls.map(({ wall }) => wall), ...meshes.map(({ mesh }) => mesh)], false)[0];
    state.selected = null;
    if (hit && hit.object === pins) state.selected = { cell: hit.instanceId };
    else if (hit && walls.some(({ wall }) => wall === hit.object)) state.selected = cellNear(hit.point);
    else if (hit) state.selected = { object: meshes.find(({ mesh }) => mesh === hit.object).ids[hit.instanceId] };
    else state.selected = cellBeside(caster.ray);
    byId('inspect').hidden = !state.selected;
    if (state.selected) byId('quantity').replaceChildren(...quantities().map(({ name }, i) => new Option(name, i)));
    state.shown = -1;
  }

  // The cell beside the gap through which a ray passes; null if it passes beside the table.
  function cellBeside(ray) {
    const at = ray.intersectPlane(new THREE.Plane(new THREE.Vector3(0, 0, 1), -(scene.low + scene.high) / 2), new THREE.Vector3());
    return at && cellNear(at);
  }

  // The cell over which a point lies; null if it lies beside the table.
  function cellNear(at) {
    const away = (place) => Math.hypot(place.x - at.x, place.y - at.y);
    const nearest = there.reduce((best, place) => away(place) < away(best) ? place : best);
    return away(nearest) < scene.pitch ? { cell: places.indexOf(nearest) } : null;
  }

  const last = scene.time.length - 1;
  // The speed of an object over a frame, u/s; NaN where it does not exist, and without a frame before it.
  function speedOf(frame, id) {
    const from = Math.max(frame - 1, 0), to = Math.max(frame, 1), p = series.position;
    if (!p || to > last || p.missing(from, 3 * id) || p.missing(to, 3 * id)) return NaN;
    return Math.hypot(...[0, 1, 2].map((k) => p.value(to, 3 * id + k) - p.value(from, 3 * id + k))) / (scene.time[to] - scene.time[from]);
  }

  function objectName(id) {
    const label = scene.objects[id].label;
    return label ? `Object ${id}: ${label}` : `Object ${id}`;
  }
  const cellName = (cell) => `Cell, row ${Math.floor(cell / scene.columns)}, column ${cell % scene.columns}`;
  const shownUnit = (unit) => unit.replaceAll('*', '·').replaceAll('^2', '²').replaceAll('^3', '³');  // "mass*u/s^2"
  const channelTitle = ({ name, unit }) => name.replace('/', ': ') + (unit ? `, ${shownUnit(unit)}` : '');

  // The quantities of the selection that can be plotted: a name, the value at a frame, and by how much values differ.
  function quantities() {
    const { object: id, cell } = state.selected, p = series.position;
    if (cell !== undefined)
      return Object.values(series).filter((s) => s.values === cells).map((s) =>
        ({ name: channelTitle(s), range: s.high - s.low, of: (f) => s.missing(f, cell) ? NaN : s.value(f, cell) }));
    const along = (k) => (f) => !p || p.missing(f, 3 * id) ? NaN : p.value(f, 3 * id + k);
    return [...(last > 0 ? [{ name: 'speed, u/s', of: (f) => speedOf(f, id) }] : []),
      ...['x', 'y', 'z'].map((axis, k) => ({ name: `${axis}, u`, range: p ? p.high - p.low : 0, of: along(k) }))];
  }

  function showSelection(frame) {
    if (!state.selected) return;
    const panel = byId('inspect'), { object: id, cell } = state.selected;
    const values = quantities().map(({ name, range, of }) => [name, numberText(of(frame), range)]);
    panel.querySelector('h2').textContent = cell !== undefined ? cellName(cell) : objectName(id);
    if (cell === undefined) values.unshift(['shape', scene.objects[id].shape]);
    panel.querySelector('dl').replaceChildren(...values.flatMap(([name, value]) => {
      const term = document.createElement('dt'), detail = document.createElement('dd');
      term.textContent = name;
      detail.textContent = value;
      return [term, detail];
    }));
  }

  // The outline of the selected object, or of the top of the selected cell, is visible through what hides it. The stencil
  // buffer keeps it outside the shape: the shape fills it, then each larger copy draws where nothing has been drawn.
  const outline = ['mask', 'rim', 'halo'].map((part, i) => {
    const mesh = new THREE.Mesh(pins.geometry, new THREE.MeshBasicMaterial({
      color: part === 'rim' ? 0xffd23f : 0x1b2027, colorWrite: part !== 'mask', transparent: true, depthTest: false, depthWrite: false,
      stencilWrite: true, stencilFunc: part === 'mask' ? THREE.AlwaysStencilFunc : THREE.EqualStencilFunc,
      stencilZPass: THREE.IncrementStencilOp }));
    mesh.renderOrder = 1 + i;
    mesh.frustumCulled = false;
    return { mesh, pixels: [0, 3, 4.5][i] };
  });
  const marker = new THREE.Group().add(...outline.map(({ mesh }) => mesh)), cellTop = new THREE.BoxGeometry(2, 2, 2);
  world.add(marker);
  state.marker = marker;
  function setMarker(frame) {
    marker.visible = state.selected !== null && (state.selected.cell !== undefined || poseOf(frame, state.selected.object));
    if (!marker.visible) return;
    const { object: id, cell } = state.selected, object = scene.objects[id];
    const geometry = object ? meshes.find(({ ids }) => ids.includes(id)).mesh.geometry : cellTop;
    const half = object ? object.half : [scene.top[0] / 2, scene.top[1] / 2, 0.05 * scene.pitch];
    const size = object ? scaleOf(object) : half;
    if (object) {
      marker.position.copy(centre);
      marker.quaternion.copy(turn);
    } else {
      const place = places[cell];
      marker.position.set(place.x, place.y, shownHeight[cell]);
      marker.quaternion.setFromAxisAngle(camera.up, place.angle);
    }
    const pixel = 2 * Math.tan(camera.fov * Math.PI / 360) * camera.position.distanceTo(marker.position) / byId('view').clientHeight;
    for (const { mesh, pixels } of outline) {
      mesh.geometry = geometry;
      mesh.scale.set(...size.map((s, k) => s * (1 + pixels * pixel / half[k])));
    }
  }

  // ---- Labels on a 2-D overlay
  const paper = byId('labels').getContext('2d');
  function drawLabels(frame) {
    const ratio = window.devicePixelRatio, canvas = paper.canvas;
    paper.clearRect(0, 0, canvas.width, canvas.height);
    if (!byId('names').checked) return;
    paper.font = `${12 * ratio}px system-ui, "DejaVu Sans", sans-serif`;
    paper.textAlign = 'center';
    paper.lineWidth = 3 * ratio;
    paper.strokeStyle = '#fffc';
    paper.fillStyle = '#1b2027';
    scene.objects.forEach((object, id) => {
      if (!poseOf(frame, id)) return;
      centre.z += object.half[2];
      centre.project(camera);
      if (centre.z > 1) return;
      const x = (centre.x + 1) / 2 * canvas.width, y = (1 - centre.y) / 2 * canvas.height - 4 * ratio;
      const text = object.label ? `${object.label} ${id}` : `${id}`;
      paper.strokeText(text, x, y);
      paper.fillText(text, x, y);
    });
  }

  const channels = scene.series.filter(({ name }) => !['position', 'orientation', 'motion', 'skin'].includes(name));
  byId('cells').replaceChildren(new Option('plain', ''), ...channels.map((channel) => new Option(channelTitle(channel), channel.name)));
  function showLegend() {
    const channel = series[byId('cells').value];
    byId('legend').hidden = !channel;
    state.shown = -1;
    if (!channel) return;
    byId('legend-name').textContent = byId('cells').selectedOptions[0].text;
    for (const end of ['low', 'high']) byId(`legend-${end}`).textContent = numberText(channel[end], channel.high - channel.low);
    const bar = byId('legend').querySelector('canvas').getContext('2d');
    for (let x = 0; x < 220; ++x) {
      bar.fillStyle = `rgb(${paletteColour(scene.palette, x / 219).map(Math.round)})`;
      bar.fillRect(x, 0, 1, 1);
    }
  }

  // The framing follows the area until the user moves the camera.
  function resize() {
    const { clientWidth: width, clientHeight: height } = byId('scene-area');
    if (width === 0 || height === 0) return;
    renderer.setSize(width, height, false);
    camera.aspect = width / height;
    camera.updateProjectionMatrix();
    paper.canvas.width = width * window.devicePixelRatio;
    paper.canvas.height = height * window.devicePixelRatio;
    if (state.view) frameTable(state.view);
    state.shown = -1;
  }

  controls.addEventListener('start', () => { state.view = null; });

  return {
    frameTable, select, quantities, objectName, cellName, channelTitle, showLegend, setColours, setObjects: buildObjects, resize, speedOf, grid,
    show(frame) {
      mechanisms.set(frame);
      setPins(frame, series[byId('cells').value]);
      setObjects(frame);
      showSelection(frame);
    },
    draw(frame) {
      controls.update();
      setWalls();
      setMarker(frame);   // its width depends on the camera
      renderer.render(world, camera);
      drawLabels(frame);
    },
    dispose() {
      controls.dispose();
      world.traverse((part) => {
        part.geometry?.dispose();
        part.material?.dispose();
      });
    },
  };
}
