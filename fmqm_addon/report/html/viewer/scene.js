"use strict";
// From data to what three.js draws.
fmqmViewer.scene = (() => {
  const STEPS = 65535;
  const GRID = 48; // cells along the longest side, each with the patches that may be nearest in it
  const FEW = 4;

  // (columns x rows) numbers, column after column, of what packing.packed wrote.
  async function unpacked(text, columns, Kind) {
    const raw = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
    const stream = new Blob([raw]).stream().pipeThrough(new DecompressionStream("deflate"));
    const numbers = new Kind(await new Response(stream).arrayBuffer());
    const rows = numbers.length / columns;
    for (let column = 0; column < columns; column++) {
      for (let k = column * rows + 1; k < (column + 1) * rows; k++) numbers[k] += numbers[k - 1]; // wraps around
    }
    return numbers;
  }

  async function geometryOf(mesh) {
    const [steps, uvSteps, normalSteps, index] = await Promise.all([
      unpacked(mesh.positions.data, 3, Uint16Array),
      unpacked(mesh.uv, 2, Uint16Array),
      unpacked(mesh.normals, 2, Uint16Array),
      unpacked(mesh.index, 1, Uint32Array),
    ]);
    const count = steps.length / 3;
    const { low, span } = mesh.positions;
    const positions = new Float32Array(3 * count);
    const normals = new Float32Array(3 * count);
    for (let k = 0; k < count; k++) {
      for (let axis = 0; axis < 3; axis++) {
        positions[3 * k + axis] = low[axis] + (steps[axis * count + k] / STEPS) * span[axis];
      }
      let x = (2 * normalSteps[k]) / STEPS - 1;
      let y = (2 * normalSteps[count + k]) / STEPS - 1;
      const z = 1 - Math.abs(x) - Math.abs(y);
      if (z < 0) {
        [x, y] = [(1 - Math.abs(y)) * (x < 0 ? -1 : 1), (1 - Math.abs(x)) * (y < 0 ? -1 : 1)];
      }
      const length = Math.hypot(x, y, z);
      normals.set([x / length, y / length, z / length], 3 * k);
    }
    const uv = new Float32Array(2 * count);
    const geometry = new THREE.BufferGeometry();
    mesh.skins.forEach((skin, number) => {
      geometry.addGroup(3 * skin.first, 3 * skin.count, number);
      for (let corner = 3 * skin.first; corner < 3 * (skin.first + skin.count); corner++) {
        const k = index[corner]; // of this skin alone
        uv[2 * k] = skin.low[0] + (uvSteps[k] / STEPS) * skin.span[0];
        uv[2 * k + 1] = skin.low[1] + (uvSteps[count + k] / STEPS) * skin.span[1];
      }
    });
    const tint = new Uint8Array(3 * count).fill(255);
    if (mesh.colors) {
      const columns = await unpacked(mesh.colors, 3, Uint8Array);
      for (let k = 0; k < count; k++) for (let c = 0; c < 3; c++) tint[3 * k + c] = columns[c * count + k];
    }
    geometry.setAttribute("position", new THREE.BufferAttribute(positions, 3));
    geometry.setAttribute("normal", new THREE.BufferAttribute(normals, 3));
    geometry.setAttribute("uv", new THREE.BufferAttribute(uv, 2));
    geometry.setAttribute("tint", new THREE.BufferAttribute(tint, 3, true));
    geometry.setIndex(new THREE.BufferAttribute(index, 1));
    geometry.computeBoundingBox();
    return geometry;
  }

  async function textureOf(skin, uri) {
    const image = new Image();
    image.src = uri;
    await image.decode();
    const texture = new THREE.Texture(image);
    const wraps = { repeat: THREE.RepeatWrapping, mirror: THREE.MirroredRepeatWrapping };
    texture.wrapS = texture.wrapT = wraps[skin.wrap] ?? texture.wrapS; // clamped, if nothing is said
    texture.magFilter = skin.smooth ? THREE.LinearFilter : THREE.NearestFilter;
    texture.minFilter = skin.shrinks ? THREE.LinearMipmapLinearFilter : THREE.LinearFilter;
    texture.generateMipmaps = skin.shrinks;
    texture.anisotropy = skin.shrinks ? 4 : 1;
    texture.needsUpdate = true;
    return texture;
  }

  function tableOf(data, width, height, type, filter) {
    const texture = new THREE.DataTexture(data, width, height, THREE.RGBAFormat, type);
    texture.minFilter = texture.magFilter = filter;
    texture.needsUpdate = true;
    return texture;
  }

  function rampTexture() {
    const bytes = fmqmViewer.ramp.flatMap((color) => [1, 3, 5].map((k) => parseInt(color.slice(k, k + 2), 16)).concat(255));
    return tableOf(new Uint8Array(bytes), fmqmViewer.ramp.length, 1, undefined, THREE.LinearFilter);
  }

  // For each cell of a grid the patches whose centers are nearest to its middle.
  function candidatesOf(centers, box) {
    const sides = box.max.clone().sub(box.min);
    const size = Math.max(sides.x, sides.y, sides.z) / GRID + 1e-6;
    const [nx, ny, nz] = sides.toArray().map((side) => Math.floor(side / size) + 1);
    const found = new Uint16Array(4 * nx * ny * nz);
    const count = centers.length / 3;
    const near = new Float64Array(FEW);
    const which = new Uint16Array(FEW);
    let next = 0;
    for (let k = 0; k < nz; k++) {
      for (let j = 0; j < ny; j++) {
        for (let i = 0; i < nx; i++) {
          const x = box.min.x + (i + 0.5) * size, y = box.min.y + (j + 0.5) * size, z = box.min.z + (k + 0.5) * size;
          near.fill(Infinity);
          which.fill(0);
          for (let p = 0; p < count; p++) {
            const dx = centers[3 * p] - x, dy = centers[3 * p + 1] - y, dz = centers[3 * p + 2] - z;
            const squared = dx * dx + dy * dy + dz * dz;
            if (squared >= near[FEW - 1]) continue;
            let place = FEW - 1;
            for (; place > 0 && near[place - 1] > squared; place--) {
              near[place] = near[place - 1];
              which[place] = which[place - 1];
            }
            near[place] = squared;
            which[place] = p;
          }
          for (let place = 0; place < FEW; place++) found[next++] = near[place] < Infinity ? which[place] : which[0];
        }
      }
    }
    const texture = new THREE.Data3DTexture(found, nx, ny, nz);
    texture.format = THREE.RGBAIntegerFormat;
    texture.type = THREE.UnsignedShortType;
    texture.internalFormat = "RGBA16UI";
    texture.needsUpdate = true;
    return { texture, size };
  }

  async function cellsOf(cells) {
    const columns = await unpacked(cells.data, 3, Uint8Array);
    const count = columns.length / 3;
    const bytes = new Uint8Array(4 * count);
    for (let k = 0; k < count; k++) for (let c = 0; c < 3; c++) bytes[4 * k + c] = columns[c * count + k];
    const texture = new THREE.Data3DTexture(bytes, ...cells.shape);
    texture.format = THREE.RGBAFormat;
    texture.minFilter = texture.magFilter = THREE.LinearFilter;
    texture.needsUpdate = true;
    const span = new THREE.Vector3(...cells.shape).multiplyScalar(cells.size);
    return { cells: { value: texture }, cellsLow: { value: new THREE.Vector3(...cells.low) }, cellsSpan: { value: span } };
  }

  // Whether a surface stands between an eye and a place on it: Möller and Trumbore's test of its triangles.
  function hides(geometry, eye, place) {
    const p = geometry.attributes.position.array;
    const index = geometry.index.array;
    const [ex, ey, ez] = eye.toArray();
    const dx = place.x - ex, dy = place.y - ey, dz = place.z - ez;
    const before = 1 - 0.01 / Math.hypot(dx, dy, dz); // what is this near does not hide it
    for (let k = 0; k < index.length; k += 3) {
      const a = 3 * index[k], b = 3 * index[k + 1], c = 3 * index[k + 2];
      const ux = p[b] - p[a], uy = p[b + 1] - p[a + 1], uz = p[b + 2] - p[a + 2];
      const vx = p[c] - p[a], vy = p[c + 1] - p[a + 1], vz = p[c + 2] - p[a + 2];
      const hx = dy * vz - dz * vy, hy = dz * vx - dx * vz, hz = dx * vy - dy * vx;
      const scale = ux * hx + uy * hy + uz * hz;
      if (scale === 0) continue;
      const sx = ex - p[a], sy = ey - p[a + 1], sz = ez - p[a + 2];
      const u = (sx * hx + sy * hy + sz * hz) / scale;
      if (u < 0 || u > 1) continue;
      const qx = sy * uz - sz * uy, qy = sz * ux - sx * uz, qz = sx * uy - sy * ux;
      const v = (dx * qx + dy * qy + dz * qz) / scale;
      if (v < 0 || u + v > 1) continue;
      const t = (vx * qx + vy * qy + vz * qz) / scale;
      if (t > 0 && t < before) return true;
    }
    return false;
  }

  // Both surfaces of a pair, each a mesh with a second one for its edges, and the uniforms that all share.
  async function pairOf(reference, level) {
    const meshes = [reference.mesh, level.mesh];
    const uris = { ...reference.mesh.images, ...level.mesh.images };
    const geometries = await Promise.all(meshes.map(geometryOf));
    const box = geometries[0].boundingBox.clone().union(geometries[1].boundingBox);
    const { centers } = level.heat;
    const grid = candidatesOf(centers, box);
    const table = new Float32Array((4 * centers.length) / 3);
    for (let p = 0; p < centers.length / 3; p++) table.set(centers.slice(3 * p, 3 * p + 3), 4 * p);
    const patches = tableOf(table, centers.length / 3, 1, THREE.FloatType, THREE.NearestFilter);
    const shared = {
      ramp: { value: rampTexture() }, patches: { value: patches }, candidates: { value: grid.texture },
      gridLow: { value: box.min }, gridSize: { value: grid.size }, partial: { value: level.heat.partial },
      lit: { value: true }, heat: { value: false }, ofPatches: { value: true }, field: { value: 0 },
      low: { value: 0 }, high: { value: 1 },
    };
    const nothing = tableOf(new Uint8Array(4), 1, 1, undefined, THREE.NearestFilter);
    const kept = [shared.ramp.value, patches, grid.texture, nothing, ...geometries];
    const textures = new Map();
    const surfaces = [];
    for (const [number, mesh] of meshes.entries()) {
      const cells = await cellsOf(level.heat.cells[number]);
      kept.push(cells.cells.value);
      const materials = [];
      for (const skin of mesh.skins) {
        const key = JSON.stringify([skin.image, skin.wrap, skin.smooth]);
        if (skin.image && !textures.has(key)) textures.set(key, await textureOf(skin, uris[skin.image]));
        const image = { value: textures.get(key) ?? nothing };
        for (const wire of [false, true]) {
          materials.push(
            new THREE.ShaderMaterial({
              uniforms: { ...shared, ...cells, image, hasImage: { value: Boolean(skin.image) }, wire: { value: wire } },
              vertexShader: fmqmViewer.shaders.vertex,
              fragmentShader: fmqmViewer.shaders.fragment,
              side: THREE.DoubleSide,
              wireframe: wire,
              transparent: wire,
              depthWrite: !wire,
              polygonOffset: !wire,
              polygonOffsetFactor: 1,
              polygonOffsetUnits: 1,
            }),
          );
        }
      }
      const solid = new THREE.Mesh(geometries[number], materials.filter((material) => !material.wireframe));
      const edges = new THREE.Mesh(geometries[number], materials.filter((material) => material.wireframe));
      kept.push(...materials);
      surfaces.push({ solid, edges, materials });
    }
    kept.push(...textures.values());
    const scene = new THREE.Scene();
    for (const { solid, edges } of surfaces) scene.add(solid, edges);

    return {
      scene,
      box,
      points: geometries.map((geometry) => geometry.attributes.position.array),
      // One surface, as it is or painted, alone.
      choose(number, heat, wire) {
        shared.heat.value = heat;
        surfaces.forEach(({ solid, edges, materials }, which) => {
          solid.visible = which === number;
          edges.visible = which === number && wire;
          for (const material of materials) material.uniformsNeedUpdate = true;
        });
      },
      hides: (eye, place) => hides(geometries[0], eye, place),
      light(lit) {
        shared.lit.value = lit;
      },
      layer(layer) {
        shared.ofPatches.value = layer.values !== null;
        shared.field.value = layer.name === "NCF_DIFFERENCE" ? 0 : 1;
        [shared.low.value, shared.high.value] = [layer.low, layer.high];
        if (layer.values === null) return;
        layer.values.forEach((value, p) => (table[4 * p + 3] = value));
        patches.needsUpdate = true;
      },
      dispose() {
        for (const each of kept) each.dispose();
      },
    };
  }

  return { pairOf, unpacked };
})();
