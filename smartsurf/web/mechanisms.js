// Draws the mechanisms of cells other than pins with flat tips, like the simulator's own view, with one instanced mesh per
// kind of part.
import * as THREE from 'three';

const kIvory = 0xede8db, kOrange = 0xf28c1a, kTyre = 0x33363b, kIron = 0xc7c9cc, kCopper = 0x9e6b42;
const kRed = 0xdb1a1f, kBlue = 0x1a47e0, kAir = 0x73c7f2, kRubber = 0xb3b8bd, kShaken = 0xfab81f, kSheet = 0x8599a8;
const kPaleArrow = 0xfacc73, kStrongArrow = 0xd9380d;
const kQuiet = 0.02;   // relative strength below which nothing is drawn

// Paints each triangle in one of two colours.
function painted(geometry, first, second, isSecond) {
  const flat = geometry.index ? geometry.toNonIndexed() : geometry;
  const at = flat.attributes.position, colours = new Float32Array(3 * at.count);
  const a = new THREE.Color(first), b = new THREE.Color(second);
  for (let i = 0; i < at.count; i += 3) {
    const mean = (axis) => (at[axis](i) + at[axis](i + 1) + at[axis](i + 2)) / 3;
    const colour = isSecond(mean('getX'), mean('getY'), mean('getZ')) ? b : a;
    for (let k = 0; k < 3; ++k) colour.toArray(colours, 3 * (i + k));
  }
  flat.setAttribute('color', new THREE.BufferAttribute(colours, 3));
  return flat;
}
const octants = (x, y, z) => x * y * z > 0;
const paintedBall = () => painted(new THREE.SphereGeometry(1, 16, 8), kIvory, kOrange, octants);
const paintedWheel = () => painted(new THREE.CylinderGeometry(1, 1, 2, 16), kTyre, kOrange,
  (x, y, z) => Math.floor((Math.atan2(z, x) / Math.PI + 1) * 4) % 2 === 0);
// An arrow from x = −1 to x = 1.
function arrow() {
  const shaft = new THREE.BoxGeometry(1.1, 0.7, 0.7).translate(-0.45, 0, 0).toNonIndexed();
  const head = new THREE.ConeGeometry(1.2, 0.9, 6).rotateZ(-Math.PI / 2).translate(0.55, 0, 0).toNonIndexed();
  const all = new THREE.BufferGeometry();
  for (const name of ['position', 'normal'])
    all.setAttribute(name, new THREE.Float32BufferAttribute([...shaft.attributes[name].array, ...head.attributes[name].array], 3));
  return all;
}
const disc = (radius, height) => new THREE.CylinderGeometry(radius, radius, height, 20).rotateX(Math.PI / 2).translate(0, 0, height / 2);

export function makeMechanisms(scene, series, world, placeOf) {
  const motion = series.motion, top = Math.min(...scene.top), pitch = scene.pitch;
  const recess = new Float32Array(scene.rows * scene.columns), works = [];
  const matrix = new THREE.Matrix4(), stands = new THREE.Matrix4(), turn = new THREE.Matrix4(), colour = new THREE.Color();
  const axis = new THREE.Vector3(), nowhere = new THREE.Matrix4().makeScale(0, 0, 0);

  function addKind(geometry, count, options = {}) {
    const material = options.opacity
      ? new THREE.MeshBasicMaterial({ transparent: true, opacity: options.opacity, depthWrite: false, side: THREE.DoubleSide })
      : new THREE.MeshStandardMaterial({ roughness: 0.6, vertexColors: Boolean(geometry.attributes.color) });
    const mesh = new THREE.InstancedMesh(geometry, material, count);
    mesh.frustumCulled = false;
    mesh.castShadow = !options.opacity;
    mesh.receiveShadow = !options.opacity;
    if (options.coloured) for (let i = 0; i < count; ++i) mesh.setColorAt(i, colour.set(kIron));
    world.add(mesh);
    return mesh;
  }
  const mixed = (from, to, t) => colour.set(from).lerp(new THREE.Color(to), Math.min(Math.max(t, 0), 1));

  // Each maker creates the meshes for the cells of one mechanism. It returns a function (i, at, m) that
  // updates the instances of the i-th cell, at the pose `at` with the state `m`, and returns the meshes that
  // it changed.
  const makers = {
    ball(spec, cells) {
      const mesh = addKind(paintedBall(), cells.length), radius = Math.min(spec.radius[0], 0.5 * top);
      return (i, at, m) => {
        turn.makeRotationY(m.b).multiply(matrix.makeRotationX(m.a)).scale(axis.set(radius, radius, radius));
        mesh.setMatrixAt(i, at.lowered(radius).multiply(turn));
        recess[at.cell] = 0.75 * radius;
        return [mesh];
      };
    },
    wheels(spec, cells) {
      const radius = Math.min(spec.radius[0], 0.3 * top), mesh = addKind(paintedWheel(), 2 * cells.length);
      const set = (i, at, x, y, angle, turned) => {
        const s = at.lowered(radius).multiply(matrix.makeRotationZ(spec.angle[0]));
        s.multiply(matrix.makeTranslation(x * top, y * top, 0)).multiply(matrix.makeRotationZ(angle));
        s.multiply(matrix.makeRotationY(turned)).scale(axis.set(radius, 0.11 * top, radius));
        mesh.setMatrixAt(i, s);
      };
      return (i, at, m) => {
        set(2 * i, at, -0.15, 0.22, 0, m.a);
        set(2 * i + 1, at, 0.22, -0.15, Math.PI / 2, m.b);
        recess[at.cell] = 0.9 * radius;
        return [mesh];
      };
    },
    rotor(spec, cells) {
      const points = spec.points, half = new THREE.Vector3(...spec.half_axes);
      // A rotor given by its points is drawn as the ellipsoid inscribed in their bounding box.
      if (points) {
        const span = (k) => Math.max(...points.filter((_, i) => i % 3 === k).map(Math.abs));
        half.set(span(0), span(1), span(2));
      }
      const scale = Math.min(1, 0.55 * pitch / Math.max(half.x, half.y, half.z));
      const mesh = addKind(paintedBall(), cells.length), axle = new THREE.Vector3(...spec.axis).normalize();
      return (i, at, m) => {
        turn.makeRotationAxis(axle, m.a);
        const e = turn.elements, highest = Math.hypot(e[2] * half.x, e[6] * half.y, e[10] * half.z);
        turn.scale(axis.copy(half).multiplyScalar(scale));
        mesh.setMatrixAt(i, at.lowered(scale * highest).multiply(turn));
        recess[at.cell] = highest;
        return [mesh];
      };
    },
    force_field(spec, cells) {
      const mesh = addKind(arrow(), cells.length, { coloured: true });
      return (i, at, m) => {
        const force = new THREE.Vector3(m.a, m.b, m.level), strength = Math.min(1, force.length());
        if (strength < kQuiet) { mesh.setMatrixAt(i, nowhere); return [mesh]; }
        const along = force.normalize(), long = pitch * (0.16 + 0.3 * strength), wide = pitch * (0.09 + 0.07 * strength);
        turn.makeRotationFromQuaternion(new THREE.Quaternion().setFromUnitVectors(new THREE.Vector3(1, 0, 0), along));
        turn.scale(axis.set(long, wide, wide));
        // Forces are in the table's axes, whatever the rotation of the cell.
        mesh.setMatrixAt(i, matrix.makeTranslation(at.x, at.y, at.z + long * Math.abs(along.z) + wide).multiply(turn));
        mesh.setColorAt(i, mixed(kPaleArrow, kStrongArrow, strength));
        return [mesh];
      };
    },
    magnet(spec, cells) {
      const rim = addKind(disc(0.46 * top, 0.06 * top), cells.length, { coloured: true });
      const core = addKind(disc(0.34 * top, 0.1 * top), cells.length, { coloured: true });
      return (i, at, m) => {
        rim.setMatrixAt(i, at.lowered(0));
        rim.setColorAt(i, colour.set(kCopper));
        core.setMatrixAt(i, at.lowered(0));
        core.setColorAt(i, mixed(kIron, m.level < 0 ? kBlue : kRed, Math.sqrt(Math.abs(m.level))));
        return [rim, core];
      };
    },
    air_jet(spec, cells) {
      const nozzle = addKind(disc(0.42 * top, 0.1 * top), cells.length, { coloured: true });
      const cone = new THREE.CylinderGeometry(0.45 * pitch, 0.18 * pitch, 1, 12, 1, true).rotateX(Math.PI / 2).translate(0, 0, 0.5);
      const plume = addKind(cone, cells.length, { coloured: true, opacity: 0.25 });
      const highest = Math.min(spec.reach[0], 2 * pitch), lean = spec.lean[0];
      return (i, at, m) => {
        const flow = Math.min(Math.max(m.level, 0), 1);
        nozzle.setMatrixAt(i, at.lowered(0));
        nozzle.setColorAt(i, mixed(kRubber, kAir, flow));
        plume.setColorAt(i, colour.set(kAir));
        const s = at.lowered(0);
        turn.set(1, 0, Math.tan(Math.min(lean, 1.3)) * Math.cos(m.a), 0, 0, 1, Math.tan(Math.min(lean, 1.3)) * Math.sin(m.a), 0,
          0, 0, 1, 0, 0, 0, 0, 1);
        plume.setMatrixAt(i, flow < kQuiet ? nowhere
          : s.multiply(turn).scale(axis.set(1, 1, highest * (0.2 + 0.8 * flow) * Math.cos(lean))));
        return [nozzle, plume];
      };
    },
    pin(spec, cells) {
      const shape = (spec['tip.shape'] || [0])[0];
      if (shape === 0) return null;
      const { radius, height } = spec.tip;
      let geometry, depth = scene.length;
      if (shape === 3) {
        const x = scene.top[0] / 2 - radius, y = scene.top[1] / 2 - radius;
        const outline = new THREE.Shape();
        [[x, y], [-x, y], [-x, -y], [x, -y]].forEach(([u, v], k) => outline.absarc(u, v, radius, k * Math.PI / 2, (k + 1) * Math.PI / 2));
        geometry = new THREE.ExtrudeGeometry(outline, { depth, bevelEnabled: false, curveSegments: 6 }).translate(0, 0, -depth);
      } else {
        const outline = [];
        for (let i = 0; i <= (shape === 1 ? 8 : 1); ++i) {
          const angle = i * Math.PI / 16;
          outline.push(shape === 1 ? new THREE.Vector2(radius * Math.sin(angle), radius * (Math.cos(angle) - 1))
            : new THREE.Vector2(i * radius, -i * height));
        }
        depth += height;
        outline.push(new THREE.Vector2(radius, -depth));
        geometry = new THREE.LatheGeometry(outline.reverse(), 24).rotateX(Math.PI / 2);
      }
      const mesh = addKind(geometry, cells.length);
      mesh.material.color.set(kRubber);
      mesh.material.side = THREE.DoubleSide;
      return (i, at) => {
        mesh.setMatrixAt(i, at.lowered(0));
        recess[at.cell] = depth;
        return [mesh];
      };
    },
    delta(spec, cells) {
      const { radius, length } = spec.tip, workspace = spec['workspace.radius'][0];
      const reach = spec.arms.radius, arm = spec.arms.length;
      const capsule = new THREE.CapsuleGeometry(radius, length - 2 * radius, 8, 24).rotateX(Math.PI / 2);
      const tips = addKind(capsule.translate(0, 0, -length / 2), cells.length);
      const arms = addKind(new THREE.BoxGeometry(0.3 * radius, 0.3 * radius, 1), 3 * cells.length);
      tips.material.color.set(kRubber);
      arms.material.color.set(kTyre);
      const up = new THREE.Vector3(0, 0, 1), along = new THREE.Vector3();
      return (i, at, m) => {
        const x = workspace * m.a, y = workspace * m.b;
        tips.setMatrixAt(i, matrix.makeTranslation(at.x + x, at.y + y, at.z));
        for (let k = 0; k < 3; ++k) {
          const angle = Math.PI / 2 + k * Math.PI * 2 / 3;
          const u = reach * Math.cos(angle) - x, v = reach * Math.sin(angle) - y;
          along.set(u, v, -Math.sqrt(Math.max(0, arm * arm - u * u - v * v)));
          const span = along.length();
          turn.makeRotationFromQuaternion(new THREE.Quaternion().setFromUnitVectors(up, along.clone().normalize()));
          turn.scale(axis.set(1, 1, span));
          arms.setMatrixAt(3 * i + k, matrix.makeTranslation(at.x + x + along.x / 2, at.y + y + along.y / 2,
            at.z - length + along.z / 2).multiply(turn));
        }
        recess[at.cell] = length + scene.length;
        return [tips, arms];
      };
    },
    tile(spec, cells) {
      if (spec.command[0] === 1) {
        const thick = spec.thickness[0], mesh = addKind(new THREE.BoxGeometry(scene.top[0], scene.top[1], thick), cells.length);
        mesh.material.color.set(kRubber);
        const below = thick + Math.hypot(...scene.top) / 2 * Math.sin(spec.max_tilt[0]);
        return (i, at, m) => {
          turn.makeRotationY(m.b).multiply(matrix.makeRotationX(m.a)).multiply(matrix.makeTranslation(0, 0, -thick / 2));
          mesh.setMatrixAt(i, at.lowered(0).multiply(turn));
          recess[at.cell] = below;
          return [mesh];
        };
      }
      const mesh = addKind(new THREE.BoxGeometry(scene.top[0], scene.top[1], 0.1 * pitch), cells.length, { coloured: true });
      return (i, at, m) => {
        const slope = (low, high) => Math.min(Math.max((high - low) / (2 * pitch), -0.7), 0.7);
        const near = (rows, columns) => at.heightNear(rows, columns);
        const east = slope(near(0, -1), near(0, 1)), north = slope(near(1, 0), near(-1, 0));
        turn.makeRotationFromEuler(new THREE.Euler(Math.atan(north), -Math.atan(east), 0));
        mesh.setMatrixAt(i, at.lowered(0.05 * pitch).multiply(turn));
        mesh.setColorAt(i, mixed(kRubber, kShaken, m.level));
        recess[at.cell] = 0.15 * pitch;
        return [mesh];
      };
    },
  };

  scene.mechanisms.forEach((spec, index) => {
    const cells = [];
    for (let cell = 0; cell < recess.length; ++cell)
      if (placeOf(cell).mechanism === index) cells.push(cell);
    const set = makers[spec.model] && cells.length > 0 ? makers[spec.model](spec, cells) : null;
    if (set) works.push({ cells, set });
  });

  // A sheet over the cells, with two triangles between four nodes.
  const sheet = scene.skin && series.skin ? makeSheet(scene.skin) : null;
  function makeSheet({ rows, columns, west, east, south, north }) {
    const geometry = new THREE.PlaneGeometry(east - west, north - south, columns - 1, rows - 1);
    const mesh = new THREE.Mesh(geometry, new THREE.MeshStandardMaterial({ color: kSheet, roughness: 0.6, side: THREE.DoubleSide }));
    mesh.position.set((west + east) / 2, (south + north) / 2, 0);
    mesh.frustumCulled = false;
    mesh.castShadow = mesh.receiveShadow = true;
    world.add(mesh);
    return geometry;
  }
  function bendSheet(frame) {
    const at = sheet.attributes.position;
    for (let i = 0; i < at.count; ++i) at.setZ(i, series.skin.value(frame, i));
    at.needsUpdate = true;
    sheet.computeVertexNormals();
  }
  // How far below its height each cell is drawn under a sheet: the sheet bends off the edges of the tops, which lie at its
  // height, and they would show through it.
  const drop = new Float32Array(recess.length);
  const covered = sheet ? coveredCells(scene.skin) : [];
  // Lists, for each cell under the sheet, the nodes over its top and the next ones outside it.
  function coveredCells({ rows, columns, west, east, south, north }) {
    const around = (from, to, count, centre, edge) => {
      const step = (to - from) / (count - 1), ends = [centre - edge / 2, centre + edge / 2].map((u) => (u - from) / step);
      return [Math.max(0, Math.floor(Math.min(...ends))), Math.min(count - 1, Math.ceil(Math.max(...ends)))];
    };
    const cells = [];
    for (let cell = 0; cell < drop.length; ++cell) {
      const place = placeOf(cell), nodes = [];
      if (place.mechanism < 0 || place.mechanism === scene.mechanisms.length) continue;  // empty, or of the border
      const [firstRow, lastRow] = around(north, south, rows, place.y, scene.top[1]);
      const [firstColumn, lastColumn] = around(west, east, columns, place.x, scene.top[0]);
      for (let row = firstRow; row <= lastRow; ++row)
        for (let column = firstColumn; column <= lastColumn; ++column) nodes.push(row * columns + column);
      cells.push({ cell, nodes });
    }
    return cells;
  }
  function dropUnderSheet(frame) {
    for (const { cell, nodes } of covered) {
      const height = series.height ? series.height.value(frame, cell) : scene.low;
      const lowest = nodes.reduce((least, node) => Math.min(least, series.skin.value(frame, node)), height);
      drop[cell] = height - lowest + 0.02 * pitch;
    }
  }

  function standing(frame, cell) {
    const place = placeOf(cell), height = (c) => (series.height ? series.height.value(frame, c) : scene.low);
    const at = {
      cell, x: place.x, y: place.y, z: height(cell) - drop[cell],
      // The cell's frame, lowered by that distance below its top.
      lowered: (by) => stands.makeTranslation(place.x, place.y, at.z - by).multiply(new THREE.Matrix4().makeRotationZ(place.angle)),
      heightNear(rows, columns) {
        const row = Math.floor(cell / scene.columns) + rows, column = cell % scene.columns + columns;
        const inside = row >= 0 && column >= 0 && row < scene.rows && column < scene.columns;
        const there = row * scene.columns + column;
        return inside && placeOf(there).mechanism >= 0 ? height(there) : at.z;
      },
    };
    return at;
  }

  return {
    recess,
    set(frame) {
      recess.fill(0);
      if (sheet) {
        bendSheet(frame);
        dropUnderSheet(frame);
      }
      for (const { cells, set } of works)
        cells.forEach((cell, i) => {
          const number = (k) => (motion ? motion.value(frame, 3 * cell + k) : 0);
          for (const mesh of set(i, standing(frame, cell), { a: number(0), b: number(1), level: number(2) })) {
            mesh.instanceMatrix.needsUpdate = true;
            if (mesh.instanceColor) mesh.instanceColor.needsUpdate = true;
          }
        });
      for (let cell = 0; cell < drop.length; ++cell) recess[cell] += drop[cell];
    },
  };
}
