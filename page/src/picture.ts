// SPDX-License-Identifier: MIT
//
// The picture of a motion: body, ghost, arrows, string, and optional parts.

import {
  BoxGeometry, BufferAttribute, BufferGeometry, CanvasTexture, Color, DirectionalLight, DoubleSide, EdgesGeometry, FrontSide, Group, HemisphereLight, Line, LineBasicMaterial,
  LineSegments, Matrix4, Mesh, MeshBasicMaterial, MeshLambertMaterial, NotEqualStencilFunc, Points, PointsMaterial, ReplaceStencilOp, Scene,
  SphereGeometry, SRGBColorSpace, Vector3,
} from "three";
import { Arrow, Cord, Scales } from "./picture_arrows.ts";
import { Eye, type Free } from "./picture_camera.ts";
import { FlatPicture } from "./picture_flat.ts";
import { Renderer } from "./picture_renderer.ts";
import { PoinsotPicture } from "./picture_poinsot.ts";
import { shadedSurface, type Surface } from "./picture_surface.ts";
import { construction } from "./poinsot.ts";
import type { BodyInfo, Flying, Snapshot, Vec3 } from "./source.ts";
import { words } from "./words.ts";
import { short } from "./words_numbers.ts";

export const COLOURS = {
  body: { true: 0xf2a33a, box: 0x4a86dd, other: 0x8f9a4a }, kept: 0x6b7385,
  omega: 0x0f9d8a, momentum: 0x7a45d1, string: 0xd1432f, force: 0xd1432f, torque: 0xb8860b, weight: 0x2f63ad,
  axes: [0xd1432f, 0x1f9d55, 0x2f63ad], trace: 0xc2347f, inertia: 0xc79a12, angle: 0x1d2433, chalk: 0xffffff,
} as const;

/** Lengths of the first L, omega and load arrows, and the largest length of any arrow, in body sizes (diagonals of its
 * box). */
const FIRST_MOMENTUM = 0.58, FIRST_OMEGA = 0.47, FIRST_LOAD = 0.36, LONGEST = 0.63;
const FRAMED = 0.69;
/** Radii of shafts, in body sizes. */
const STRONG = 0.0135, PLAIN = 0.009, CORD = 0.0075;
const LIGHT = new Vector3(-0.35, -0.5, 1);
const MOST_TRACE = 4000;
/** Font size of labels at the browser's default; half the width of a letter, and half the height of a line. */
const LETTER_PX = 17, HALF_PX = 5.8, LINE_PX = 12;
/** Tension relative to the weight below which a string is shown as slack. */
const SLACK = 1e-3;
/** Colours of the background: plain, or a gradient on fast renderers. */
const SKY = 0xf1f4f9, LIGHT_SKY = "#ffffff", DARK_SKY = "#dfe5f0";

/** Pose of a body, now or earlier. */
export interface Pose { readonly row: readonly number[]; readonly scale: Vec3; readonly com: Vec3 }

/** A recent impulse whose arrow is shown: impulse [N s] at a point [mesh]. */
export interface Blow { readonly point: Vec3; readonly impulse: Vec3; readonly axes: "body" | "world" }

/** A named mark on the body. */
export interface Mark { readonly point: Vec3; readonly text: string; readonly isCentre: boolean }

/** The parts drawn besides body and loads. */
export interface Shown {
  readonly marks: readonly Mark[];
  /** Whether parts that show the centre of mass are hidden. */
  readonly hidesCentre: boolean;
  readonly apart: boolean;
  readonly model: string;
  readonly ghostModel: string;
  readonly gravity: Vec3;
  readonly blows: readonly Blow[];
  readonly boundingBox: boolean;
  readonly inertiaBox: boolean;
  readonly ellipsoid: boolean;
  readonly principal: boolean;
  readonly poinsot: boolean;
  readonly cones: boolean;
  /** Omegas up to now since the last change of L [rad/s, world]. */
  readonly herpolhode: readonly Vec3[];
  /** Axes turned by the user, as columns, in body axes. */
  readonly turned: readonly number[] | null;
  /** Points of the trace [m, world], the oldest first. */
  readonly trace: readonly number[] | null;
  readonly tracePoint: Vec3 | null;
  /** Chalk lines as pairs of points [mesh]. */
  readonly chalk: readonly number[];
  /** The two directions [world] of the protractor. */
  readonly protractor: readonly [Vec3, Vec3] | null;
  readonly kept: Pose | null;
  /** Position of the keyboard's aim [px]. */
  readonly aim: readonly [number, number] | null;
}

interface Copy { readonly frame: Group; readonly mesh: Mesh; readonly edges: LineSegments }

/** A text at a position in the picture. */
class Label {
  readonly node = document.createElement("span");
  private text = "";
  /** Position [px] while it is shown. */
  place: readonly [number, number] | null = null;
  constructor(into: HTMLElement, colour: string) {
    this.node.className = "label";
    this.node.style.color = colour;
    into.append(this.node);
    this.hide();
  }
  show(text: string, x: number, y: number): void {
    if (text !== this.text) this.node.textContent = this.text = text;
    this.place = [x, y];
    this.node.style.visibility = "visible";
    this.node.style.transform = `translate(${x.toFixed(1)}px, ${y.toFixed(1)}px) translate(-50%, -50%)`;
  }
  hide(): void { this.place = null; this.node.style.visibility = "hidden"; }
}

export class Picture {
  readonly eye = new Eye();
  /** Null without WebGL; then ``flat`` draws. */
  readonly renderer: Renderer | null;
  private readonly flat: FlatPicture | null;
  private readonly scene = new Scene();
  private readonly scales = new Scales();
  private readonly body: Copy;
  private readonly ghost: Copy;
  private readonly kept: Copy;
  private readonly shadow: Mesh;
  private readonly floor: LineSegments;
  private readonly omega = new Arrow(COLOURS.omega);
  private readonly momentum = new Arrow(COLOURS.momentum);
  private readonly weight = new Arrow(COLOURS.weight);
  private readonly loads: Arrow[] = [];
  private readonly cord = new Cord(COLOURS.string);
  private readonly ghostCord = new Cord(0x7da9e6);
  private readonly boundingBox: LineSegments;
  private readonly inertiaBox: Mesh;
  private readonly ellipsoid: Mesh;
  private readonly poinsot = new PoinsotPicture();
  private readonly principal: readonly Arrow[];
  private readonly turned: readonly Arrow[];
  private readonly trace: Line;
  private readonly traceDots: Points;
  private readonly arc: Line;
  private readonly chalk = new LineSegments(new BufferGeometry(), new LineBasicMaterial({ color: COLOURS.chalk }));
  private readonly chalkDots = new Points(this.chalk.geometry, new PointsMaterial({ color: COLOURS.chalk, size: 4, sizeAttenuation: false }));
  private chalked: readonly number[] = [];
  private readonly labels: Record<"omega" | "momentum" | "weight" | "string" | "angle" | "one" | "two" | "three" | "ghost", Label>;
  private readonly loadLabels: Label[] = [];
  private readonly markLabels: (readonly [Label, Label])[] = [];
  private readonly labelRoom: HTMLElement;
  private surface: Surface | null = null;
  private info: BodyInfo | null = null;
  private free: Free = { left: 0, top: 0, width: 1, height: 1 };
  private offset = new Vector3();
  private size = 1;
  /** Size of labels relative to LETTER_PX. */
  private letter = 1;
  private reach = 0.5;
  /** Positions of the labels of this frame [px], with half their widths. */
  private readonly said: { readonly x: number; readonly y: number; readonly half: number }[] = [];

  constructor(stage: HTMLElement, labelRoom: HTMLElement) {
    let renderer: Renderer | null = null;
    try { renderer = new Renderer(stage); } catch { /* reported by the page, and drawn flat */ }
    this.renderer = renderer;
    this.flat = renderer ? null : new FlatPicture(stage);
    this.labelRoom = labelRoom;
    const { scene } = this;
    scene.add(new HemisphereLight(0xffffff, 0xb9c0cf, 2.1));
    const sun = new DirectionalLight(0xfff6e8, 1.9);
    sun.position.copy(LIGHT);
    sun.up.set(0, 0, 1);
    scene.add(sun);

    this.body = this.copy(COLOURS.body.true, 1);
    this.ghost = this.copy(COLOURS.body.box, 0.36);
    this.kept = this.copy(COLOURS.kept, 0.3);
    this.shadow = new Mesh(new BufferGeometry(), new MeshBasicMaterial({
      color: 0x24324f, transparent: true, opacity: 0.13, depthWrite: false, side: DoubleSide,
      stencilWrite: true, stencilRef: 1, stencilFunc: NotEqualStencilFunc, stencilZPass: ReplaceStencilOp,
    }));
    this.shadow.matrixAutoUpdate = false;
    this.shadow.frustumCulled = false;
    this.shadow.renderOrder = 1;
    this.floor = grid();
    scene.add(this.shadow, this.floor);

    const line = (colour: number): LineBasicMaterial => new LineBasicMaterial({ color: colour, transparent: true, opacity: 0.75 });
    this.boundingBox = new LineSegments(new EdgesGeometry(new BoxGeometry(1, 1, 1)), line(COLOURS.kept));
    const clear = (colour: number): MeshLambertMaterial => new MeshLambertMaterial({ color: colour, transparent: true, opacity: 0.32, depthWrite: false });
    this.inertiaBox = new Mesh(new BoxGeometry(1, 1, 1), clear(COLOURS.inertia));
    this.ellipsoid = new Mesh(new SphereGeometry(1, 40, 26), clear(0x1f9d55));
    for (const shape of [this.inertiaBox, this.ellipsoid]) shape.matrixAutoUpdate = false;
    this.principal = COLOURS.axes.map((colour) => new Arrow(colour));
    this.turned = COLOURS.axes.map((colour) => new Arrow(colour));
    const places = new BufferGeometry().setAttribute("position", new BufferAttribute(new Float32Array(3 * MOST_TRACE), 3));
    this.trace = new Line(places, line(COLOURS.trace));
    this.traceDots = new Points(places, new PointsMaterial({ color: COLOURS.trace, size: 3, sizeAttenuation: false }));
    this.arc = new Line(new BufferGeometry().setAttribute("position", new BufferAttribute(new Float32Array(3 * 33), 3)), new LineBasicMaterial({ color: COLOURS.angle, depthTest: false, transparent: true }));
    this.trace.frustumCulled = this.traceDots.frustumCulled = this.arc.frustumCulled = false;
    this.arc.renderOrder = 25;
    this.body.mesh.add(this.chalk, this.chalkDots);
    this.chalk.frustumCulled = this.chalkDots.frustumCulled = false;
    this.body.frame.add(this.boundingBox, this.inertiaBox, this.ellipsoid, this.poinsot.onBody);
    scene.add(this.poinsot.inSpace);
    for (const arrow of [this.omega, this.momentum, this.weight, ...this.principal, ...this.turned]) scene.add(arrow.node);
    scene.add(this.cord.node, this.ghostCord.node, this.trace, this.traceDots, this.arc);

    const label = (colour: string): Label => new Label(labelRoom, colour);
    this.labels = {
      omega: label("#07675a"), momentum: label("#5d2bb0"), weight: label("#244f8c"), string: label("#a3210f"), angle: label("#1d2433"),
      one: label("#a3210f"), two: label("#11683a"), three: label("#244f8c"), ghost: label("#244f8c"),
    };
  }

  private copy(colour: number, opacity: number): Copy {
    const clear = opacity < 1;
    const mesh = new Mesh(new BufferGeometry(), new MeshLambertMaterial({ color: colour, transparent: clear, opacity, depthWrite: !clear }));
    const edges = new LineSegments(new BufferGeometry(), new LineBasicMaterial({ color: colour, transparent: true, opacity: clear ? 0.6 : 0.35 }));
    const frame = new Group();
    mesh.add(edges);
    frame.add(mesh);
    // Transparent copies of the body are drawn after the arrows that are visible through them.
    mesh.renderOrder = clear ? 3 : 0;
    edges.renderOrder = clear ? 4 : 2;
    this.scene.add(frame);
    return { frame, mesh, edges };
  }

  /** Set the body, or its changes. */
  setBody(info: BodyInfo): void {
    if (info.vertices !== this.info?.vertices) {
      const before = this.surface, surface = shadedSurface(info.vertices, info.triangles);
      this.surface = surface;
      for (const copy of [this.body, this.ghost, this.kept]) { copy.mesh.geometry = surface.geometry; copy.edges.geometry = surface.edges; }
      this.shadow.geometry = surface.geometry;
      before?.geometry.dispose();
      before?.edges.dispose();
      this.scales.forget();
      // The inside of an open surface is visible, too.
      (this.body.mesh.material as MeshLambertMaterial).side = Number.isFinite(info.volume) ? FrontSide : DoubleSide;
    }
    this.info = info;
    this.size = 2 * info.length || 1;
    const { low, high } = this.surface!;
    let reach = 0;
    for (let corner = 0; corner < 8; corner++) {
      const at = [0, 1, 2].map((k) => ((corner >> k) & 1 ? high : low)[k]! * info.scale[k]! - info.com[k]!);
      reach = Math.max(reach, Math.hypot(...at));
    }
    this.reach = reach;
  }

  /** Set the background; on slow renderers one colour, because the browser composites a transparent
   * canvas once more. */
  private sky(): void {
    const plain = !this.renderer?.shown.smooth;
    if (plain) { this.scene.background = new Color(SKY); return; }
    const canvas = document.createElement("canvas");
    canvas.width = canvas.height = 256;
    const paper = canvas.getContext("2d")!, shade = paper.createRadialGradient(115, 90, 0, 115, 90, 240);
    shade.addColorStop(0, LIGHT_SKY);
    shade.addColorStop(0.5, "#f3f5fa");
    shade.addColorStop(1, DARK_SKY);
    paper.fillStyle = shade;
    paper.fillRect(0, 0, 256, 256);
    const texture = new CanvasTexture(canvas);
    texture.colorSpace = SRGBColorSpace;
    this.scene.background = texture;
  }

  fit(width: number, height: number, free: Free): void {
    this.sky();
    this.letter = Number.parseFloat(getComputedStyle(this.labels.omega.node).fontSize) / LETTER_PX;
    this.free = free;
    this.eye.fit(width, height, free);
    this.renderer?.resize(width, height);
    this.flat?.resize(width, height);
  }

  /** Reset the scales of arrows, and the camera's position. */
  restart(now: Snapshot): void {
    this.scales.forget();
    this.eye.jump([now.body.row[0]!, now.body.row[1]!, now.body.row[2]!]);
  }

  /** Draw the ghost beside the body instead of in place. */
  setApart(apart: boolean): void { this.offset = apart ? new Vector3(...this.eye.right()).setZ(0).normalize().multiplyScalar(1) : new Vector3(); }

  /** Draw an instant, `seconds` after the previous frame; the camera doesn't move while the body is held. */
  draw(now: Snapshot, shown: Shown, seconds: number, held: boolean): void {
    const { body, ghost } = now, { size, eye } = this;
    const at = new Vector3(body.row[0], body.row[1], body.row[2]), aside = this.offset.clone().multiplyScalar(2.1 * this.reach);
    const apart = shown.apart && ghost !== null;
    eye.frame(Math.max(1.03 * this.reach, FRAMED * size) * (apart ? 1.55 : 1));
    const middle = shown.hidesCentre ? this.onBody(this.boxMiddle()) : at;
    if (!held) eye.follow(apart ? at.clone().addScaledVector(aside, 0.5) : middle, seconds);
    eye.place(held ? 0 : seconds);

    place(this.body, body, this.surface, null);
    this.body.frame.visible = true;
    place(this.ghost, ghost, this.surface, apart ? aside : null);
    place(this.kept, shown.kept, this.surface, null);
    paint(this.body, shown.model);
    paint(this.ghost, shown.ghostModel);

    this.said.length = 0;
    this.drawMotion(body, at, shown);
    this.drawWeight(shown.hidesCentre ? [0, 0, 0] : shown.gravity, body, at);
    this.drawLoads(body, shown.blows);
    this.drawString(this.cord, body, shown.gravity, null);
    this.drawString(this.ghostCord, apart ? ghost : null, shown.gravity, aside);
    this.drawShapes(shown, body, at);
    this.drawMeasures(shown, at);
    this.drawMarks(shown.marks, at);
    this.drawFloor(middle);

    if (this.renderer) this.renderer.draw(this.scene, eye.camera);
    else this.flat?.draw(eye, this.scene);
  }

  /** Put a label beyond an arrow's tip. */
  private tag(label: Label, text: string, tip: Vector3, from: Vector3, beyond = 17): void {
    const end = this.eye.project(tip, new Vector3()), start = this.eye.project(from, new Vector3());
    const dx = end.x - start.x, dy = end.y - start.y, length = Math.hypot(dx, dy);
    const [ux, uy] = length > 1 ? [dx / length, dy / length] : [0, -1];
    this.put(label, text, end.x + ux * (beyond + Math.abs(ux) * HALF_PX * text.length) * this.letter, end.y + uy * beyond * this.letter);
  }

  /** Put a label as close to a screen position [px] as possible within the uncovered part of the window; above or
   * beside a label that is there already. */
  private put(label: Label, text: string, x: number, y: number): void {
    const { left, top, width, height } = this.free, half = HALF_PX * this.letter * text.length, line = LINE_PX * this.letter;
    let atX = Math.max(left + half, Math.min(left + width - half, x)), atY = Math.max(top + line, Math.min(top + height - line, y));
    for (const one of this.said) {
      if (Math.abs(one.x - atX) >= one.half + half || Math.abs(one.y - atY) >= 1.5 * line) continue;
      if (one.y - 1.5 * line >= top + line) atY = one.y - 1.5 * line;
      else atX = one.x + (one.x + one.half + 2 * half <= left + width ? 1 : -1) * (one.half + half);
    }
    this.said.push({ x: atX, y: atY, half });
    label.show(text, atX, atY);
  }

  private drawMotion(body: Flying, at: Vector3, shown: Shown): void {
    const made = !shown.hidesCentre && (shown.poinsot || shown.cones) ? construction(body, this.info!, this.size) : null;
    if (made) this.poinsot.show(made, this.info!.axes, shown.herpolhode, at, this.size, shown); else this.poinsot.hide();
    const { size } = this, natural = Math.sqrt(9.81 / size), moment = (this.info!.moments[0] + this.info!.moments[1] + this.info!.moments[2]) / 3;
    const parts = [
      [this.omega, this.labels.omega, "ω", new Vector3(...body.omega), FIRST_OMEGA, natural, 0.8],
      [this.momentum, this.labels.momentum, "L", new Vector3(...body.momentum), FIRST_MOMENTUM, moment * natural, 1],
    ] as const;
    for (const [arrow, label, kind, vector, first, usual, thick] of parts) {
      const value = vector.length(), scaled = this.scales.length(kind, value, first * size, LONGEST * size, usual);
      // In Poinsot's construction, omega ends where the ellipsoid touches the plane.
      const length = shown.hidesCentre ? 0 : made && arrow === this.omega ? made.unit * value : scaled;
      if (!length) { arrow.hide(); label.hide(); continue; }
      arrow.show(at, vector.multiplyScalar(length / value), thick * STRONG * size);
      this.tag(label, kind, at.clone().add(vector), at);
    }
  }

  private drawWeight(gravity: Vec3, body: Flying, at: Vector3): void {
    const force = new Vector3(...gravity).multiplyScalar(body.massKg), value = force.length();
    const length = this.scales.length("weight", value, 0.45 * this.size, LONGEST * this.size, value);
    if (!length) { this.weight.hide(); this.labels.weight.hide(); return; }
    this.weight.show(at, force.multiplyScalar(length / value), PLAIN * this.size);
    this.tag(this.labels.weight, words.picture.weight(short(value)), at.clone().add(force), at);
  }

  private drawLoads(body: Flying, blows: readonly Blow[]): void {
    const { size } = this, found: { from: Vector3; vector: Vector3; kind: string; unit: string; colour: number; pushes: boolean }[] = [];
    for (const load of body.loads) {
      const point = new Vector3(...load.point);
      if (Math.hypot(...load.force)) found.push({ from: point, vector: new Vector3(...load.force), kind: "force", unit: "N", colour: COLOURS.force, pushes: true });
      if (Math.hypot(...load.torque)) found.push({ from: point, vector: new Vector3(...load.torque), kind: "torque", unit: "N m", colour: COLOURS.torque, pushes: false });
    }
    for (const blow of blows) found.push({ from: this.onBody(blow.point), vector: blow.axes === "body" ? turned(body.rotation, blow.impulse) : new Vector3(...blow.impulse), kind: "impulse", unit: "N s", colour: COLOURS.force, pushes: true });
    for (let k = 0; k < Math.max(found.length, this.loads.length); k++) {
      const load = found[k];
      if (!load) { this.loads[k]?.hide(); this.loadLabels[k]?.hide(); continue; }
      if (!this.loads[k]) {
        const arrow = new Arrow(load.colour);
        this.loads.push(arrow);
        this.loadLabels.push(new Label(this.labelRoom, "#a3210f"));
        this.scene.add(arrow.node);
      }
      const value = load.vector.length(), length = this.scales.length(load.kind, value, FIRST_LOAD * size, LONGEST * size, value);
      const vector = load.vector.multiplyScalar(length / (value || 1));
      // The tip of a pushing force is at the point, like a finger.
      const from = load.pushes ? load.from.clone().sub(vector) : load.from, tip = from.clone().add(vector);
      this.loads[k]!.show(from, vector, PLAIN * size);
      const text = `${short(value)} ${load.unit}`;
      if (length) this.tag(this.loadLabels[k]!, text, load.pushes ? from : tip, load.pushes ? tip : from);
      else this.loadLabels[k]!.hide();
    }
  }

  /** Present world position of a point of the mesh. */
  onBody(point: Vec3): Vector3 {
    const { mesh } = this.body, middle = this.surface!.middle;
    mesh.updateWorldMatrix(true, false);
    return new Vector3(point[0] - middle[0], point[1] - middle[1], point[2] - middle[2]).applyMatrix4(mesh.matrixWorld);
  }

  private drawString(cord: Cord, flying: Flying | null, gravity: Vec3, aside: Vector3 | null): void {
    const string = flying?.string ?? null, label = aside ? null : this.labels.string;
    if (!string) { cord.hide(); label?.hide(); return; }
    const hand = new Vector3(...string.end), knot = new Vector3(...string.knot), down = new Vector3(...gravity);
    if (aside) { hand.add(aside); knot.add(aside); }
    if (down.length() > 0) down.normalize(); else down.set(0, 0, -1);
    cord.show(hand, knot, string.restLength, down, CORD * this.size * (aside ? 0.6 : 1));
    if (!label) return;
    const isSlack = Math.abs(string.tension) < SLACK * flying!.massKg * Math.hypot(...gravity), text = `${isSlack ? "0" : short(string.tension)} N`, seen = this.eye.project(hand, new Vector3());
    if (this.inFree(seen.x, seen.y)) { this.tag(label, text, hand, knot, 24); return; }
    // The string's end is out of view: put the label beside the string, near the body.
    const at = this.eye.project(knot, new Vector3()), away = Math.hypot(seen.x - at.x, seen.y - at.y) || 1, up = 70 * this.letter;
    this.put(label, text, at.x + (up * (seen.x - at.x)) / away + (16 + HALF_PX * text.length) * this.letter, at.y + (up * (seen.y - at.y)) / away);
  }

  private drawShapes(shown: Shown, body: Flying, at: Vector3): void {
    const info = this.info!, surface = this.surface!;
    const low = surface.low, high = surface.high;
    this.boundingBox.visible = shown.boundingBox;
    this.boundingBox.position.set(...([0, 1, 2].map((k) => 0.5 * (low[k]! + high[k]!) * body.scale[k]! - body.com[k]!) as [number, number, number]));
    this.boundingBox.scale.set(...([0, 1, 2].map((k) => Math.max(1e-9, Math.abs((high[k]! - low[k]!) * body.scale[k]!))) as [number, number, number]));
    // The uniform box and the uniform ellipsoid of this mass and these moments.
    const [a, b, c] = info.moments, spread = [b + c - a, a + c - b, a + b - c].map((s) => Math.sqrt(Math.max(0, s) / info.massKg));
    const axes = info.axes;
    const turn = new Matrix4().set(axes[0]!, axes[1]!, axes[2]!, 0, axes[3]!, axes[4]!, axes[5]!, 0, axes[6]!, axes[7]!, axes[8]!, 0, 0, 0, 0, 1);
    const sized = (factor: number): Matrix4 => turn.clone().multiply(new Matrix4().makeScale(...(spread.map((s) => factor * s) as [number, number, number])));
    this.inertiaBox.visible = shown.inertiaBox;
    if (shown.inertiaBox) this.inertiaBox.matrix.copy(sized(Math.sqrt(6)));
    this.ellipsoid.visible = shown.ellipsoid;
    if (shown.ellipsoid) this.ellipsoid.matrix.copy(sized(Math.sqrt(2.5)));

    const names = [this.labels.one, this.labels.two, this.labels.three] as const;
    for (const [arrows, from, on, letters] of [
      [this.principal, info.axes, shown.principal, ["I₁", "I₂", "I₃"]],
      [this.turned, shown.turned, shown.turned !== null, ["x′", "y′", "z′"]],
    ] as const) {
      for (let k = 0; k < 3; k++) {
        if (!on || !from) { arrows[k]!.hide(); continue; }
        const vector = turned(body.rotation, [from[k]!, from[3 + k]!, from[6 + k]!]).multiplyScalar(0.58 * this.size);
        arrows[k]!.show(at, vector, 0.6 * PLAIN * this.size);
        this.tag(names[k]!, letters[k]!, at.clone().add(vector), at, 12);
      }
    }
    if (!shown.principal && !shown.turned) for (const name of names) name.hide();
  }

  private drawMeasures(shown: Shown, at: Vector3): void {
    if (shown.chalk !== this.chalked) {
      this.chalked = shown.chalk;
      const { middle } = this.surface!;
      this.chalk.geometry.setAttribute("position", new BufferAttribute(Float32Array.from(shown.chalk, (x, k) => x - middle[k % 3]!), 3));
    }
    this.chalk.visible = this.chalkDots.visible = shown.chalk.length > 0;
    const trace = shown.trace, count = trace ? Math.min(MOST_TRACE, trace.length / 3) : 0;
    this.trace.visible = this.traceDots.visible = count > 1;
    if (trace && count > 1) {
      const places = this.trace.geometry.attributes["position"] as BufferAttribute, from = trace.length - 3 * count;
      for (let k = 0; k < 3 * count; k++) (places.array as Float32Array)[k] = trace[from + k]!;
      places.needsUpdate = true;
      this.trace.geometry.setDrawRange(0, count);
    }
    this.arc.visible = shown.protractor !== null;
    if (!shown.protractor) { this.labels.angle.hide(); return; }
    const one = new Vector3(...shown.protractor[0]), two = new Vector3(...shown.protractor[1]);
    if (!(one.length() > 0 && two.length() > 0)) { this.arc.visible = false; this.labels.angle.hide(); return; }
    one.normalize();
    two.normalize();
    const angle = one.angleTo(two), side = two.clone().addScaledVector(one, -two.dot(one)).normalize();
    const places = this.arc.geometry.attributes["position"] as BufferAttribute, radius = 0.36 * this.size, point = new Vector3();
    for (let k = 0; k <= 32; k++) {
      point.copy(at).addScaledVector(one, radius * Math.cos((angle * k) / 32)).addScaledVector(side, radius * Math.sin((angle * k) / 32));
      places.setXYZ(k, point.x, point.y, point.z);
    }
    places.needsUpdate = true;
    point.copy(at).addScaledVector(one, radius * Math.cos(0.5 * angle)).addScaledVector(side, radius * Math.sin(0.5 * angle));
    this.tag(this.labels.angle, `${((angle * 180) / Math.PI).toFixed(1)}°`, point, at, 16);
  }

  /** Centre of the mesh's bounding box [mesh]. */
  private boxMiddle(): Vec3 {
    const { low, high } = this.surface!;
    return [0, 1, 2].map((k) => 0.5 * (low[k]! + high[k]!)) as unknown as Vec3;
  }

  private drawMarks(marks: readonly Mark[], at: Vector3): void {
    for (let k = 0; k < Math.max(marks.length, this.markLabels.length); k++) {
      const mark = marks[k];
      if (!mark) { for (const label of this.markLabels[k] ?? []) label.hide(); continue; }
      const [dot, name] = (this.markLabels[k] ??= [new Label(this.labelRoom, "#1d2433"), new Label(this.labelRoom, "#1d2433")]), point = this.onBody(mark.point), seen = this.eye.project(point, new Vector3());
      dot.node.classList.add("dot");
      dot.show(mark.isCentre ? "⊕" : "●", seen.x, seen.y);
      if (mark.isCentre) name.hide(); // its symbol is on the body, which a name would cover
      else if (this.isNearTip(seen)) this.put(name, mark.text, seen.x + (16 + HALF_PX * mark.text.length) * this.letter, seen.y);
      else this.tag(name, mark.text, point, at, 20);
    }
  }

  /** Whether the arrow of omega or L ends near a screen position [px]. */
  private isNearTip({ x, y }: Vector3): boolean {
    return [this.labels.omega, this.labels.momentum].some(({ place }) => place !== null && Math.hypot(place[0] - x, place[1] - y) < 52 * this.letter);
  }

  private drawFloor(at: Vector3): void {
    const { floor, shadow, eye } = this, cell = niceCell(0.3 * this.size), below = 1.06 * this.reach;
    // There is a floor at each multiple of a height, and a falling body passes them.
    const storey = 2.6 * below, height = Math.floor((eye.target.z + 0.35 * storey) / storey) * storey - below;
    const left = (eye.target.z - height) / storey;
    const seen = Math.max(0, Math.min(1, (left - 0.05) / 0.2, (1.1 - left) / 0.2));
    floor.scale.setScalar(cell);
    floor.position.set(Math.round(eye.target.x / cell) * cell, Math.round(eye.target.y / cell) * cell, height);
    (floor.material as LineBasicMaterial).opacity = 0.6 * seen;
    shadow.visible = (this.renderer?.shown.shadow ?? false) && seen > 0 && at.z > height;
    if (!shadow.visible) return;
    const { mesh } = this.body, sx = LIGHT.x / LIGHT.z, sy = LIGHT.y / LIGHT.z;
    mesh.updateWorldMatrix(true, false);
    shadow.matrix.set(1, 0, -sx, sx * height, 0, 1, -sy, sy * height, 0, 0, 0, height + 0.001 * cell, 0, 0, 0, 1).multiply(mesh.matrixWorld);
    (shadow.material as MeshBasicMaterial).opacity = 0.13 * seen;
  }

  /** The frame with its labels, of the whole window or of its uncovered part. */
  still(background: string, isFree = false): HTMLCanvasElement {
    const canvas = document.createElement("canvas"), ratio = 2, { width, height } = this.eye, { free } = this;
    const from = isFree ? { x: free.left - 10, y: free.top - 10, width: free.width + 20, height: free.height + 20 } : { x: 0, y: 0, width, height };
    canvas.width = ratio * from.width;
    canvas.height = ratio * from.height;
    const paper = canvas.getContext("2d")!;
    paper.scale(ratio, ratio);
    paper.translate(-from.x, -from.y);
    paper.fillStyle = background;
    paper.fillRect(0, 0, width, height);
    if (this.renderer) this.renderer.draw(this.scene, this.eye.camera);
    const drawn = this.renderer?.canvas ?? this.flat!.canvas;
    paper.drawImage(drawn, 0, 0, width, height);
    paper.textAlign = "center";
    paper.textBaseline = "middle";
    for (const node of this.labelRoom.querySelectorAll<HTMLElement>(".label")) {
      if (node.style.visibility === "hidden" || node.hidden) continue;
      const at = node.getBoundingClientRect();
      paper.font = `700 ${getComputedStyle(node).fontSize} system-ui, sans-serif`;
      paper.fillStyle = node.style.color;
      paper.fillText(node.textContent ?? "", at.left + 0.5 * at.width, at.top + 0.5 * at.height);
    }
    return canvas;
  }

  /** The frame as an image file. */
  async saved(background: string): Promise<Blob> {
    const canvas = this.still(background);
    return new Promise((done, failed) => canvas.toBlob((blob) => (blob ? done(blob) : failed(new Error("no picture"))), "image/png"));
  }

  /** Whether a screen position [px] is in the uncovered part of the window. */
  inFree(x: number, y: number): boolean {
    const { left, top, width, height } = this.free;
    return x >= left && y >= top && x <= left + width && y <= top + height;
  }
}

function place(copy: Copy, pose: Pose | null, surface: Surface | null, aside: Vector3 | null): void {
  copy.frame.visible = pose !== null;
  if (!pose || !surface) return;
  const [x, y, z, qx, qy, qz, qw] = pose.row as unknown as [number, number, number, number, number, number, number];
  copy.frame.position.set(x, y, z);
  if (aside) copy.frame.position.add(aside);
  copy.frame.quaternion.set(qx, qy, qz, qw);
  const { middle } = surface, { scale, com } = pose;
  copy.mesh.position.set(middle[0] * scale[0] - com[0], middle[1] * scale[1] - com[1], middle[2] * scale[2] - com[2]);
  copy.mesh.scale.set(scale[0], scale[1], scale[2]);
}

/** Convert a vector from body to world axes. */
function turned(R: readonly number[], [x, y, z]: Vec3): Vector3 {
  return new Vector3(R[0]! * x + R[1]! * y + R[2]! * z, R[3]! * x + R[4]! * y + R[5]! * z, R[6]! * x + R[7]! * y + R[8]! * z);
}

/** Colour a body by its tensor: true, box, or another. */
function paint(copy: Copy, model: string): void {
  const colour = colourOf(model);
  (copy.mesh.material as MeshLambertMaterial).color.setHex(colour);
  (copy.edges.material as LineBasicMaterial).color.setHex(colour).multiplyScalar(0.62);
}

export function colourOf(model: string): number {
  return model === "solid" ? COLOURS.body.true : model === "bounding_box" ? COLOURS.body.box : COLOURS.body.other;
}

/** 1, 2 or 5 times a power of ten, about as large as ``length``. */
function niceCell(length: number): number {
  const power = 10 ** Math.floor(Math.log10(length || 1)), part = length / power;
  return power * (part < 1.5 ? 1 : part < 3.5 ? 2 : part < 7.5 ? 5 : 10);
}

/** A grid in the xy plane with cells of size 1, which fades towards its rim. */
function grid(): LineSegments {
  const half = 9, places: number[] = [], colours: number[] = [], ink = new Color(0xaab4ca);
  const vertex = (x: number, y: number): void => {
    places.push(x, y, 0);
    colours.push(ink.r, ink.g, ink.b, Math.max(0, 1 - Math.hypot(x, y) / half) ** 1.4);
  };
  for (let i = -half; i <= half; i++) for (let j = -half; j < half; j++) {
    if (Math.hypot(i, j) >= half && Math.hypot(i, j + 1) >= half) continue;
    vertex(i, j); vertex(i, j + 1);
    vertex(j, i); vertex(j + 1, i);
  }
  const geometry = new BufferGeometry().setAttribute("position", new BufferAttribute(new Float32Array(places), 3)).setAttribute("color", new BufferAttribute(new Float32Array(colours), 4));
  const lines = new LineSegments(geometry, new LineBasicMaterial({ vertexColors: true, transparent: true, depthWrite: false }));
  lines.renderOrder = -1;
  lines.frustumCulled = false;
  return lines;
}
