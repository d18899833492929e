// Draws the mechanisms of cells other than pins with flat tips, like the simulator's own view, with one instanced mesh per
// kind of part. Their meshes, colours and looks are the simulator's (view/model/ActuatorGeometry.h).
import * as THREE from 'three';

// Seven numbers per vertex: position, normal and share of the accent colour.
function geometryOf({ vertices, indices }) {
  const bytes = Uint8Array.from(atob(vertices), (c) => c.charCodeAt(0));
  const all = new THREE.InterleavedBuffer(new Float32Array(bytes.buffer), 7), geometry = new THREE.BufferGeometry();
  geometry.setAttribute('position', new THREE.InterleavedBufferAttribute(all, 3, 0));
  geometry.setAttribute('normal', new THREE.InterleavedBufferAttribute(all, 3, 3));
  geometry.setAttribute('share', new THREE.InterleavedBufferAttribute(all, 1, 6));
  return geometry.setIndex(indices);
}

// Each instance has a base and an accent colour.
function colourInstances(shader) {
  shader.vertexShader = 'attribute vec4 base, accent; attribute float share; varying vec4 tint;\n'
    + shader.vertexShader.replace('#include <begin_vertex>', '#include <begin_vertex>\ntint = mix(base, accent, share);');
  shader.fragmentShader = 'varying vec4 tint;\n' + shader.fragmentShader.replace('#include <color_fragment>', 'diffuseColor *= tint;');
}

// The pose of each cell and the index of its mechanism: −1 for empty cells, one more than the last for the border.
export function cellPlaces(scene) {
  return Array.from({ length: scene.rows * scene.columns }, (_, cell) => {
    const row = Math.floor(cell / scene.columns), column = cell % scene.columns;
    const border = scene.border !== null && (row === 0 || column === 0 || row === scene.rows - 1 || column === scene.columns - 1);
    const mechanism = scene.cell ? scene.cell[cell] : 0;
    return {
      x: scene.place ? scene.place[3 * cell] : column * scene.pitch,
      y: scene.place ? scene.place[3 * cell + 1] : (scene.rows - 1 - row) * scene.pitch,
      angle: scene.place ? scene.place[3 * cell + 2] : 0,
      border,
      mechanism: border && mechanism >= 0 ? scene.mechanisms.length : mechanism,
    };
  });
}

export function makeMechanisms(scene, series, world, placeOf) {
  const motion = series.motion, top = Math.min(...scene.top), pitch = scene.pitch, c = scene.colours, looks = scene.looks;
  const recess = new Float32Array(scene.rows * scene.columns), works = [];
  const matrix = new THREE.Matrix4(), stands = new THREE.Matrix4(), turn = new THREE.Matrix4(), colour = new THREE.Color();
  const axis = new THREE.Vector3(), nowhere = new THREE.Matrix4().makeScale(0, 0, 0);

  // Returns the instances of a mesh, with its `size`.
  function addKind(mesh, count) {
    const kind = { side: THREE.DoubleSide, transparent: mesh.translucent, depthWrite: !mesh.translucent };
    const material = mesh.translucent ? new THREE.MeshBasicMaterial(kind) : new THREE.MeshStandardMaterial({ ...kind, roughness: 0.6 });
    material.onBeforeCompile = colourInstances;
    const instances = new THREE.InstancedMesh(geometryOf(mesh), material, count), { attributes } = instances.geometry;
    for (const name of ['base', 'accent'])
      instances.geometry.setAttribute(name, new THREE.InstancedBufferAttribute(new Float32Array(4 * count), 4));
    instances.frustumCulled = false;
    instances.castShadow = instances.receiveShadow = !mesh.translucent;
    world.add(instances);
    return Object.assign(instances, {
      size: new THREE.Vector3(...mesh.size),
      paint(i, base, accent, opacities = [1, 1]) {
        [base, accent].forEach((rgb, k) => {
          colour.setRGB(...rgb, THREE.SRGBColorSpace);
          attributes[k ? 'accent' : 'base'].setXYZW(i, colour.r, colour.g, colour.b, opacities[k]).needsUpdate = true;
        });
      },
      place(i, pose) {
        instances.setMatrixAt(i, pose);
        instances.instanceMatrix.needsUpdate = true;
      },
    });
  }
  const mixed = (from, to, t) => from.map((value, k) => value + (to[k] - value) * Math.min(Math.max(t, 0), 1));

  // Each maker creates the instances of the cells of one mechanism. It returns a function (i, at, m) that updates those of
  // the i-th cell, at the pose `at` with the state `m`.
  const makers = {
    ball({ meshes: [mesh] }, cells) {
      const balls = addKind(mesh, cells.length), radius = balls.size.x;
      return (i, at, m) => {
        turn.makeRotationY(m.b).multiply(matrix.makeRotationX(m.a)).scale(balls.size);
        balls.place(i, at.lowered(radius).multiply(turn));
        balls.paint(i, c.ivory, c.orange);
        recess[at.cell] = looks.ball_recess * radius;
      };
    },
    wheels(spec, cells) {
      const wheels = addKind(spec.meshes[0], 2 * cells.length), radius = wheels.size.x;
      const set = (i, at, x, y, angle, turned) => {
        const s = at.lowered(radius).multiply(matrix.makeRotationZ(spec.angle[0]));
        s.multiply(matrix.makeTranslation(x * top, y * top, 0)).multiply(matrix.makeRotationZ(angle));
        wheels.place(i, s.multiply(matrix.makeRotationY(turned)).scale(wheels.size));
        wheels.paint(i, c.tyre, c.orange);
      };
      return (i, at, m) => {
        set(2 * i, at, -looks.wheel_across, looks.wheel_along, 0, m.a);
        set(2 * i + 1, at, looks.wheel_along, -looks.wheel_across, Math.PI / 2, m.b);
        recess[at.cell] = looks.wheel_recess * radius;
      };
    },
    rotor(spec, cells) {
      const rotors = addKind(spec.meshes[0], cells.length), axle = new THREE.Vector3(...spec.axis).normalize();
      const points = (spec.points || []).reduce((all, value, k) => (k % 3 ? all.at(-1).push(value) : all.push([value]), all), []);
      const half = spec.half_axes, farthest = Math.max(...(points.length ? points.map((p) => Math.hypot(...p)) : half));
      const scale = Math.min(1, looks.max_rotor_radius * pitch / farthest);
      return (i, at, m) => {
        const e = turn.makeRotationAxis(axle, m.a).elements, height = ([x, y, z]) => e[2] * x + e[6] * y + e[10] * z;
        const highest = points.length ? Math.max(...points.map(height)) : Math.hypot(e[2] * half[0], e[6] * half[1], e[10] * half[2]);
        rotors.place(i, at.lowered(scale * highest).multiply(turn.scale(rotors.size)));
        rotors.paint(i, c.ivory, c.orange);
        recess[at.cell] = highest;
      };
    },
    force_field({ meshes: [mesh] }, cells) {
      const arrows = addKind(mesh, cells.length);
      return (i, at, m) => {
        const force = new THREE.Vector3(m.a, m.b, m.level), strength = Math.min(1, force.length());
        if (strength < looks.min_visible_level) return arrows.place(i, nowhere);
        const along = force.normalize(), long = pitch * (looks.arrow_length + looks.arrow_length_gain * strength);
        const wide = pitch * (looks.arrow_width + looks.arrow_width_gain * strength);
        axis.set(...(Math.abs(along.z) < 0.95 ? [0, 0, 1] : [1, 0, 0])).cross(along).normalize();
        turn.makeBasis(along, axis, along.clone().cross(axis)).scale(axis.set(long, wide, wide));
        // Forces are in the table's axes, whatever the rotation of the cell.
        arrows.place(i, matrix.makeTranslation(at.x, at.y, at.z + long * Math.abs(along.z) + wide).multiply(turn));
        const shade = mixed(c.weak_force, c.strong_force, strength);
        arrows.paint(i, shade, shade);
      };
    },
    conveyor(spec, cells) { return makers.force_field(spec, cells); },
    magnet({ meshes: [mesh] }, cells) {
      const coils = addKind(mesh, cells.length);
      return (i, at, m) => {
        coils.place(i, at.lowered(0).scale(coils.size));
        coils.paint(i, mixed(c.iron, m.level < 0 ? c.blue : c.red, Math.sqrt(Math.abs(m.level))), c.copper);
      };
    },
    air_jet(spec, cells) {
      const [nozzles, plumes] = spec.meshes.map((mesh) => addKind(mesh, cells.length)), lean = spec.lean[0];
      return (i, at, m) => {
        const flow = Math.min(Math.max(m.level, 0), 1);
        nozzles.place(i, at.lowered(0).scale(nozzles.size));
        nozzles.paint(i, mixed(c.rubber, c.air, flow), c.ink);
        if (flow < looks.min_visible_level) return plumes.place(i, nowhere);
        turn.set(1, 0, Math.sin(lean) * Math.cos(m.a), 0, 0, 1, Math.sin(lean) * Math.sin(m.a), 0, 0, 0, Math.cos(lean), 0, 0, 0, 0, 1);
        const s = at.lowered(-looks.plume_foot * top).multiply(turn);
        plumes.place(i, s.scale(axis.copy(plumes.size).multiply({ x: 1, y: 1, z: looks.plume_length + looks.plume_length_gain * flow })));
        plumes.paint(i, c.air, c.air, [looks.plume_opacity + looks.plume_opacity_gain * flow, 0]);
      };
    },
    pin({ meshes: [mesh], tip }, cells) {
      if (!mesh) return null;
      const tips = addKind(mesh, cells.length);
      return (i, at) => {
        tips.place(i, at.lowered(0));
        tips.paint(i, c.rubber, c.ivory);
        recess[at.cell] = tip.height + scene.length;
      };
    },
    delta(spec, cells) {
      const { length } = spec.tip, workspace = spec['workspace.radius'][0], reach = spec.arms.radius, arm = spec.arms.length;
      const tips = addKind(spec.meshes[0], cells.length), arms = addKind(spec.meshes[1], 3 * cells.length);
      const along = new THREE.Vector3();
      return (i, at, m) => {
        const x = workspace * m.a, y = workspace * m.b;
        tips.place(i, matrix.makeTranslation(at.x + x, at.y + y, at.z));
        tips.paint(i, c.rubber, c.ivory);
        for (let k = 0; k < 3; ++k) {
          const angle = Math.PI / 2 + k * Math.PI * 2 / 3;
          const u = reach * Math.cos(angle) - x, v = reach * Math.sin(angle) - y;
          along.set(u, v, -Math.sqrt(Math.max(0, arm * arm - u * u - v * v))).multiplyScalar(0.5);
          const across = Math.hypot(u, v) > 1e-6 ? axis.set(-v, u, 0).normalize() : axis.set(0, 1, 0), down = along.clone().normalize();
          turn.makeBasis(across, down.clone().cross(across), down).scale(axis.copy(arms.size).setZ(along.length()));
          arms.place(3 * i + k, matrix.makeTranslation(at.x + x + along.x, at.y + y + along.y, at.z - length + along.z).multiply(turn));
          arms.paint(3 * i + k, c.ink, c.ink);
        }
        recess[at.cell] = length + scene.length;
      };
    },
    tile(spec, cells) {
      const plates = addKind(spec.meshes[0], cells.length), half = plates.size;
      if (spec.command[0] === 1) {
        const below = 2 * half.z + Math.hypot(half.x, half.y) * Math.sin(spec.max_tilt[0]);
        return (i, at, m) => {
          turn.makeRotationY(m.b).multiply(matrix.makeRotationX(m.a)).multiply(matrix.makeTranslation(0, 0, -half.z)).scale(half);
          plates.place(i, at.lowered(0).multiply(turn));
          plates.paint(i, c.rubber, c.idle);
          recess[at.cell] = below;
        };
      }
      return (i, at, m) => {
        const slope = (low, high) => Math.min(Math.max((high - low) / (2 * pitch), -looks.max_plate_slope), looks.max_plate_slope);
        const near = (rows, columns) => at.heightNear(rows, columns);
        const east = slope(near(0, -1), near(0, 1)), north = slope(near(1, 0), near(-1, 0));
        const up = new THREE.Vector3(-east, -north, 1).normalize();
        axis.set(1, 0, east).normalize();
        turn.makeBasis(axis, up.clone().cross(axis), up);
        plates.place(i, at.lowered(half.z).multiply(turn).scale(half));
        plates.paint(i, c.rubber, mixed(c.idle, c.vibrating, m.level));
        recess[at.cell] = 3 * half.z;
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

  // A skin over the cells, whose vertices are its nodes.
  const skin = scene.skin && series.skin ? addKind(scene.skin.mesh, 1) : null;
  if (skin) {
    skin.place(0, matrix.identity());
    skin.paint(0, c.skin, c.rubber);
  }
  function bendSkin(frame) {
    const at = skin.geometry.attributes.position;
    for (let i = 0; i < at.count; ++i) at.setZ(i, series.skin.value(frame, i));
    at.needsUpdate = true;
    skin.geometry.computeVertexNormals();
  }
  // How far below its height each cell is drawn under a skin: it bends off the edges of the tops, which lie at its
  // height, and they would show through it.
  const drop = new Float32Array(recess.length);
  const covered = skin ? coveredCells(scene.skin) : [];
  // Lists, for each cell under the skin, the nodes over its top and the next ones outside it.
  function coveredCells({ columns, rowNodes, columnNodes }) {
    const cells = [];
    for (let cell = 0; cell < drop.length; ++cell) {
      const { mechanism } = placeOf(cell), nodes = [];
      if (mechanism < 0 || mechanism === scene.mechanisms.length) continue;  // empty, or of the border
      const [firstRow, lastRow] = rowNodes[Math.floor(cell / scene.columns)];
      const [firstColumn, lastColumn] = columnNodes[cell % scene.columns];
      for (let row = firstRow; row <= lastRow; ++row)
        for (let column = firstColumn; column <= lastColumn; ++column) nodes.push(row * columns + column);
      cells.push({ cell, nodes });
    }
    return cells;
  }
  function dropUnderSkin(frame) {
    for (const { cell, nodes } of covered) {
      const height = series.height ? series.height.value(frame, cell) : scene.low;
      const lowest = nodes.reduce((least, node) => Math.min(least, series.skin.value(frame, node)), height);
      drop[cell] = height - lowest + looks.skin_clearance * pitch;
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
        return height(inside && placeOf(there).mechanism >= 0 ? there : cell);
      },
    };
    return at;
  }

  return {
    recess,
    set(frame) {
      recess.fill(0);
      if (skin) {
        bendSkin(frame);
        dropUnderSkin(frame);
      }
      for (const { cells, set } of works)
        cells.forEach((cell, i) => {
          const number = (k) => (motion ? motion.value(frame, 3 * cell + k) : 0);
          set(i, standing(frame, cell), { a: number(0), b: number(1), level: number(2) });
        });
      for (let cell = 0; cell < drop.length; ++cell) recess[cell] += drop[cell];
    },
  };
}
