// The asset under the mouse: before on the left of a border, after on the right, in a light to choose, with its
// maps lit or alone. Reads the JSON of report/viewer.h from #viewer-data and fills .viewer (viewer.html). Where
// WebGL 2 is missing or something fails, the page stays as it was, with the turntable.
import * as THREE from "three";
import { OrbitControls } from "three/controls";

// A map that is switched off is replaced by the plain value.
const kMaps = [
  { name: "base_color", title: "Base colour" },
  { name: "normal", title: "Normal" },
  { name: "roughness", title: "Roughness", plain: 0.5 },
  { name: "metallic", title: "Metallic", plain: 0 },
];
const kWrap = {
  repeat: THREE.RepeatWrapping,
  clamp: THREE.ClampToEdgeWrapping,
  mirror: THREE.MirroredRepeatWrapping,
};
const kPlainGrey = new THREE.Color(0x808080), kWhite = new THREE.Color(1, 1, 1);
const kFieldOfView = 35, kElevation = 20;  // degrees, as the usual views of patina

const viewer = document.querySelector(".viewer");
const canvas = viewer.querySelector("canvas");

function bytesOf(uri) {
  const text = atob(uri.slice(uri.indexOf(",") + 1));
  const bytes = new Uint8Array(text.length);
  for (let i = 0; i < text.length; ++i) bytes[i] = text.charCodeAt(i);
  return bytes.buffer;
}

async function loadedImage(uri) {
  const image = new Image();
  image.src = uri;
  await image.decode();
  return image;
}

function geometryOf(part) {
  const geometry = new THREE.BufferGeometry();
  const set = (name, array, size, normalized) =>
    geometry.setAttribute(name, new THREE.BufferAttribute(array, size, normalized));
  set("position", new Float32Array(bytesOf(part.position)), 3);
  set("normal", new Int16Array(bytesOf(part.normal)), 3, true);
  part.uv.forEach((uv, i) => set(i ? `uv${i}` : "uv", new Float32Array(bytesOf(uv)), 2));
  if (part.color) set("color", new Float32Array(bytesOf(part.color)), 4);
  geometry.setIndex(new THREE.BufferAttribute(new Uint32Array(bytesOf(part.index)), 1));
  return geometry;
}

function textureOf(reference, images, colorSpace) {
  const texture = new THREE.Texture(images[reference.image]);
  texture.flipY = false;  // UVs start top left
  texture.colorSpace = colorSpace;
  texture.channel = reference.uv;
  [texture.wrapS, texture.wrapT] = reference.wrap.map(name => kWrap[name]);
  texture.matrixAutoUpdate = false;
  texture.matrix.fromArray(reference.matrix);
  texture.anisotropy = 8;
  texture.needsUpdate = true;
  return texture;
}

// One side of one material: what it needs to be shown lit or one map alone.
function texturesOf(maps, images) {
  const textures = {};
  for (const { name } of kMaps)
    textures[name] =
      textureOf(maps[name], images, name === "base_color" ? THREE.SRGBColorSpace : THREE.NoColorSpace);
  return textures;
}

function litMaterial(material, textures, images) {
  const lit = new THREE.MeshStandardMaterial({ side: THREE.DoubleSide });
  lit.normalScale.set(1, -1);  // tangents come from UVs, whose v points down
  if (material.emission) {
    lit.emissive = kWhite;
    lit.emissiveIntensity = material.emission.strength;
    lit.emissiveMap = textureOf(material.emission.map, images, THREE.SRGBColorSpace);
  }
  if (material.alpha) {
    lit.alphaMap = textureOf(material.alpha.map, images, THREE.NoColorSpace);
    if (material.alpha.cutoff === null) lit.transparent = true;
    else lit.alphaTest = material.alpha.cutoff;
  }
  lit.userData.setMaps = on => {
    lit.map = on.base_color ? textures.base_color : null;
    lit.color = on.base_color ? kWhite : kPlainGrey;
    lit.normalMap = on.normal ? textures.normal : null;
    lit.roughnessMap = on.roughness ? textures.roughness : null;
    lit.roughness = on.roughness ? 1 : kMaps[2].plain;
    lit.metalnessMap = on.metallic ? textures.metallic : null;
    lit.metalness = on.metallic ? 1 : kMaps[3].plain;
    lit.needsUpdate = true;
  };
  return lit;
}

// The asset before or after, as a scene whose meshes share their geometry with the other one.
function sceneOf(data, side, geometries, images) {
  const scene = new THREE.Scene();
  const textures = data.materials.map(material => texturesOf(material[side], images));
  data.parts.forEach((part, i) => {
    const material = data.materials[part.material];
    const lit = litMaterial(material, textures[part.material], images);
    const alone = new THREE.MeshBasicMaterial({ side: THREE.DoubleSide, toneMapped: false });
    lit.vertexColors = alone.vertexColors = Boolean(part.color);
    const mesh = new THREE.Mesh(geometries[i], lit);
    mesh.userData.show = shown => {
      alone.map = textures[part.material][shown] ?? null;
      mesh.material = alone.map ? alone : lit;
      alone.needsUpdate = true;
    };
    mesh.userData.setMaps = lit.userData.setMaps;
    scene.add(mesh);
  });
  return scene;
}

// Radiance with a shared exponent → a texture around the scene, filtered for every roughness.
function environmentOf(light, renderer) {
  const stored = new Uint8Array(bytesOf(light.radiance));
  const half = new Uint16Array(stored.length);
  const one = THREE.DataUtils.toHalfFloat(1);
  for (let i = 0; i < stored.length; i += 4) {
    const scale = 2 ** (stored[i + 3] - 136);
    for (let c = 0; c < 3; ++c)
      half[i + c] = THREE.DataUtils.toHalfFloat(Math.min(stored[i + c] * scale, 65504));
    half[i + 3] = one;
  }
  const map = new THREE.DataTexture(half, light.width, light.height, THREE.RGBAFormat, THREE.HalfFloatType);
  map.mapping = THREE.EquirectangularReflectionMapping;
  map.minFilter = map.magFilter = THREE.LinearFilter;
  map.needsUpdate = true;
  const filter = new THREE.PMREMGenerator(renderer);
  const { texture } = filter.fromEquirectangular(map);
  filter.dispose();
  map.dispose();
  return texture;
}

// A row of radio buttons or check boxes; `changed(value, checked)` is called when the user chooses.
function addChoices(fieldset, type, choices, changed) {
  choices.forEach(({ value, title, checked }) => {
    const label = document.createElement("label"), input = document.createElement("input");
    Object.assign(input, { type, name: fieldset.className, value, checked });
    input.addEventListener("change", () => changed(value, input.checked));
    label.append(input, ` ${title}`);
    fieldset.append(label);
  });
}

function turnByKeys(camera, controls, redraw) {
  const kStep = Math.PI / 18;
  const moves = {
    ArrowLeft: s => { s.theta -= kStep; },
    ArrowRight: s => { s.theta += kStep; },
    ArrowUp: s => { s.phi -= kStep; },
    ArrowDown: s => { s.phi += kStep; },
    "+": s => { s.radius /= 1.1; },
    "=": s => { s.radius /= 1.1; },
    "-": s => { s.radius *= 1.1; },
  };
  canvas.addEventListener("keydown", event => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    if (event.key === "Home") {
      controls.reset();
    } else if (moves[event.key]) {
      const place = new THREE.Spherical().setFromVector3(camera.position.clone().sub(controls.target));
      moves[event.key](place);
      place.makeSafe();
      camera.position.setFromSpherical(place).add(controls.target);
      controls.update();
    } else {
      return;
    }
    event.preventDefault();
    redraw();
  });
}

// A camera that sees all of the asset, and its control by mouse and fingers.
function cameraAround(scene) {
  const camera = new THREE.PerspectiveCamera(kFieldOfView);
  const center = new THREE.Box3().setFromObject(scene).getCenter(new THREE.Vector3());
  const point = new THREE.Vector3();
  let radius = 0;
  for (const { geometry } of scene.children)
    for (let i = 0; i < geometry.attributes.position.count; ++i)
      radius = Math.max(radius, point.fromBufferAttribute(geometry.attributes.position, i).distanceTo(center));
  const distance = radius / Math.sin(THREE.MathUtils.degToRad(kFieldOfView / 2));
  camera.near = distance / 100;
  camera.far = distance * 20;
  camera.position
    .setFromSphericalCoords(distance, THREE.MathUtils.degToRad(90 - kElevation), 0)
    .add(center);
  const controls = new OrbitControls(camera, canvas);
  controls.target.copy(center);
  controls.minDistance = distance / 20;
  controls.maxDistance = distance * 5;
  // The wheel scrolls the page until the asset was chosen.
  controls.enableZoom = false;
  canvas.addEventListener("pointerdown", () => canvas.focus({ preventScroll: true }));
  canvas.addEventListener("focus", () => { controls.enableZoom = true; });
  canvas.addEventListener("blur", () => { controls.enableZoom = false; });
  controls.update();
  controls.saveState();
  return { camera, controls };
}

// The border follows the slider, and the slider the border where it is dragged.
function splitBy(stage, redraw) {
  const slider = viewer.querySelector(".split input"), border = viewer.querySelector(".border");
  const moved = () => {
    stage.style.setProperty("--split", `${slider.value}%`);
    slider.setAttribute("aria-valuetext", `${slider.value} % before`);
    redraw();
  };
  slider.addEventListener("input", moved);
  border.addEventListener("pointerdown", event => border.setPointerCapture(event.pointerId));
  border.addEventListener("pointermove", event => {
    if (!border.hasPointerCapture(event.pointerId)) return;
    const box = stage.getBoundingClientRect();
    slider.value = Math.round((100 * (event.clientX - box.left)) / box.width);
    moved();
  });
  return () => slider.value / 100;
}

async function start() {
  const context = canvas.getContext("webgl2", { alpha: true, antialias: true, preserveDrawingBuffer: true });
  if (!context) return;
  const data = JSON.parse(document.getElementById("viewer-data").textContent);
  const images = await Promise.all(data.images.map(loadedImage));
  const renderer = new THREE.WebGLRenderer({ canvas, context });
  renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
  renderer.setClearColor(0x000000, 0);  // the page's ground shows around the asset
  renderer.autoClear = true;

  const geometries = data.parts.map(geometryOf);
  const sides = ["before", "after"].map(side => sceneOf(data, side, geometries, images));
  const { camera, controls } = cameraAround(sides[0]);

  let shown = "lit", waiting = false, split = () => 0.5;
  const draw = () => {
    waiting = false;
    const { clientWidth: width, clientHeight: height } = canvas;
    const cut = Math.round(split() * width);
    // A map that holds no colour is shown as its file holds it.
    const isData = shown !== "lit" && shown !== "base_color";
    renderer.outputColorSpace = isData ? THREE.LinearSRGBColorSpace : THREE.SRGBColorSpace;
    renderer.setScissorTest(true);
    renderer.setScissor(0, 0, cut, height);
    if (cut > 0) renderer.render(sides[0], camera);
    renderer.setScissor(cut, 0, width - cut, height);
    if (cut < width) renderer.render(sides[1], camera);
  };
  const redraw = () => {
    if (!waiting) requestAnimationFrame(draw);
    waiting = true;
  };
  const eachMesh = act => sides.forEach(side => side.children.forEach(act));

  const environments = [];
  const choose = light => {
    environments[light] ??= environmentOf(data.lights[light], renderer);
    sides.forEach(side => { side.environment = environments[light]; });
    renderer.toneMapping = THREE.ReinhardToneMapping;  // as in patina's pictures
    renderer.toneMappingExposure = data.lights[light].exposure;
    redraw();
  };
  addChoices(
    viewer.querySelector(".lights"), "radio",
    data.lights.map(({ name }, i) => ({ value: i, title: name, checked: i === 0 })), choose);
  addChoices(
    viewer.querySelector(".shown"), "radio",
    [{ value: "lit", title: "All, lit", checked: true }]
      .concat(kMaps.map(({ name, title }) => ({ value: name, title: `${title} alone` }))),
    name => {
      shown = name;
      eachMesh(mesh => mesh.userData.show(name));
      redraw();
    });
  const on = Object.fromEntries(kMaps.map(({ name }) => [name, true]));
  const setMaps = () => eachMesh(mesh => mesh.userData.setMaps(on));
  addChoices(
    viewer.querySelector(".maps"), "checkbox",
    kMaps.map(({ name, title }) => ({ value: name, title, checked: true })), (name, checked) => {
      on[name] = checked;
      setMaps();
      redraw();
    });

  document.documentElement.classList.add("turns");
  split = splitBy(viewer.querySelector(".stage"), redraw);
  turnByKeys(camera, controls, redraw);
  controls.addEventListener("change", redraw);
  canvas.addEventListener("webglcontextlost", () => document.documentElement.classList.remove("turns"));
  new ResizeObserver(() => {
    const { clientWidth: width, clientHeight: height } = canvas;
    if (!width || !height) return;
    renderer.setSize(width, height, false);
    camera.aspect = width / height;
    camera.updateProjectionMatrix();
    draw();
  }).observe(canvas);
  setMaps();
  choose(0);
  draw();
  viewer.dataset.state = "ready";
}

start().catch(error => {
  document.documentElement.classList.remove("turns");
  console.warn("patina: the viewer did not start:", error);
});
