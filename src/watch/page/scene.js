// The arm, what it carries, the object and the springs in 3-D, by three.js.

import {
  AmbientLight, BufferGeometry, Color, CylinderGeometry, DirectionalLight, DoubleSide, GridHelper, Group, Box3,
  Line, LineBasicMaterial, Mesh, MeshStandardMaterial, OrbitControls, PerspectiveCamera, Scene, Sphere,
  SphereGeometry, Vector3, WebGLRenderer,
} from "./vendor/three.js";

const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
const ball = new SphereGeometry(0.5, 32, 20);
const materials = new Map();

/** One material per colour. */
function material(rgba) {
  const key = rgba.join();
  if (!materials.has(key)) {
    const [r, g, b, opacity] = rgba;
    const isSolid = opacity >= 1;
    materials.set(key, new MeshStandardMaterial({
      color: new Color(r, g, b), opacity, transparent: !isSolid, depthWrite: isSolid, side: DoubleSide, roughness: 0.6,
    }));
  }
  return materials.get(key);
}

/** A pose is x, y, z and a quaternion x, y, z, w. What is no number was not measured. */
function place(object, [x, y, z, ...turn]) {
  if ([x, y, z, ...turn].includes(null)) return;
  object.position.set(x, y, z);
  object.quaternion.set(...turn);
}

function cylinder({ pose, size, bottom, top, color }, isLink) {
  const [width, , height] = size;
  const shape = new CylinderGeometry(0.5 * width * top, 0.5 * width * bottom, height, 40).rotateX(Math.PI / 2);
  const made = new Mesh(shape, material(color));
  place(made, pose);
  if (isLink) {
    // Round ends: neighbours meet at every angle.
    for (const end of [-0.5, 0.5]) {
      const cap = new Mesh(ball, made.material);
      cap.scale.setScalar(width);
      cap.position.z = end * height;
      made.add(cap);
    }
  }
  return made;
}

function sphere({ pose, size, color }) {
  const made = new Mesh(ball, material(color));
  place(made, pose);
  made.scale.set(...size.map((length) => Math.max(length, 1e-4)));
  return made;
}

function polyline({ points, color: [r, g, b] }) {
  const shape = new BufferGeometry().setFromPoints(points.map((point) => new Vector3(...point)));
  return new Line(shape, new LineBasicMaterial({ color: new Color(r, g, b) }));
}

/** A joint, as a darker ball around the beginning of its link. */
function joint({ size: [width], color: [r, g, b] }) {
  const made = new Mesh(ball, material([0.55 * r, 0.55 * g, 0.55 * b, 1]));
  made.scale.setScalar(1.35 * width);
  return made;
}

function parts(entity) {
  const isLink = entity.id.startsWith("link ");
  return [
    ...entity.cylinders.map((it) => cylinder(it, isLink)),
    ...(isLink ? entity.cylinders.map(joint) : []),
    ...entity.spheres.map(sphere),
    ...entity.lines.map(polyline),
  ];
}

export class ArmScene {
  #scene = new Scene();
  #camera = new PerspectiveCamera(35, 1, 0.05, 50);
  #frames = [];
  #springs = new Group();
  #grid = null;
  #renderer;
  #controls;
  #canvas;
  #isFramed = false;
  #isDue = false;

  constructor(canvas, still) {
    this.#canvas = canvas;
    this.#renderer = new WebGLRenderer({ canvas, antialias: true, alpha: true });
    this.#camera.up.set(0, 0, 1);
    this.#camera.position.set(1.6, -2.2, 1.4);
    this.#controls = new OrbitControls(this.#camera, canvas);
    this.#controls.addEventListener("change", () => this.#draw());
    const sun = new DirectionalLight(0xffffff, 2.2);
    sun.position.set(1.5, -2, 3);
    this.#scene.add(new AmbientLight(0xffffff, 1.3), sun, this.#springs);
    this.#build(still);
    this.#theme();
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.#theme());
    new ResizeObserver(() => this.#resize()).observe(canvas.parentElement);
    this.#resize();
  }

  #build({ frames, bodies }) {
    const byName = new Map([["world", this.#scene]]);
    for (const { name, parent } of frames) {
      const group = new Group();
      byName.get(parent).add(group);
      byName.set(name, group);
      this.#frames.push(group);
    }
    for (const entity of bodies) byName.get(entity.frame)?.add(...parts(entity));
  }

  move({ frames, springs }) {
    frames.forEach((pose, i) => place(this.#frames[i], pose));
    for (const old of [...this.#springs.children]) {
      if (old.isLine) {
        old.geometry.dispose();
        old.material.dispose();
      }
      this.#springs.remove(old);
    }
    const drawn = springs.flatMap(parts);
    if (drawn.length) this.#springs.add(...drawn);
    if (!this.#isFramed) this.resetView();
    this.#canvas.dataset.poses = Number(this.#canvas.dataset.poses ?? 0) + 1;
    this.#draw();
  }

  /** The whole arm, seen from its right and above. */
  resetView() {
    this.#isFramed = true;
    this.#scene.updateMatrixWorld(true);
    const box = new Box3().expandByPoint(new Vector3());
    for (const frame of this.#frames) box.expandByObject(frame);
    // What is thrown stays in the picture.
    box.max.z += 0.25;
    const { center, radius } = box.getBoundingSphere(new Sphere());
    const half = Math.min(1, this.#camera.aspect) * Math.tan((this.#camera.fov * Math.PI) / 360);
    this.#controls.target.copy(center);
    this.#camera.position.copy(center).addScaledVector(new Vector3(0.35, -0.85, 0.4).normalize(), (0.92 * radius) / half);
    this.#controls.update();
    this.#draw();
  }

  #theme() {
    if (this.#grid) this.#scene.remove(this.#grid);
    this.#grid = new GridHelper(4, 16, css("--grid"), css("--grid")).rotateX(Math.PI / 2);
    this.#scene.add(this.#grid);
    this.#draw();
  }

  #resize() {
    const { clientWidth: width, clientHeight: height } = this.#canvas.parentElement;
    if (!width || !height) return;
    this.#renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
    this.#renderer.setSize(width, height, false);
    this.#camera.aspect = width / height;
    this.#camera.updateProjectionMatrix();
    this.#draw();
  }

  /** At most once per picture of the display. */
  #draw() {
    if (this.#isDue) return;
    this.#isDue = true;
    requestAnimationFrame(() => {
      this.#isDue = false;
      this.#renderer.render(this.#scene, this.#camera);
    });
  }
}
