// SPDX-License-Identifier: MIT
//
// Arrows, their scales, and strings.

import { BufferAttribute, BufferGeometry, ConeGeometry, CylinderGeometry, GreaterDepth, Group, Mesh, MeshBasicMaterial, MeshLambertMaterial, SphereGeometry, Vector3 } from "three";

const UP = new Vector3(0, 1, 0);
const SHAFT = new CylinderGeometry(1, 1, 1, 18, 1).translate(0, 0.5, 0);
const HEAD = new ConeGeometry(1, 1, 24).translate(0, 0.5, 0);
const BALL = new SphereGeometry(1, 20, 14);

/** An arrow; its hidden parts shine through. */
export class Arrow {
  readonly node = new Group();
  private readonly shafts: Mesh[] = [];
  private readonly heads: Mesh[] = [];
  private readonly way = new Vector3();

  constructor(colour: number) {
    const solid = new MeshLambertMaterial({ color: colour, emissive: colour, emissiveIntensity: 0.25 });
    const behind = new MeshBasicMaterial({ color: colour, transparent: true, opacity: 0.3, depthFunc: GreaterDepth, depthWrite: false });
    for (const material of [solid, behind]) {
      const shaft = new Mesh(SHAFT, material), head = new Mesh(HEAD, material);
      if (material === behind) shaft.renderOrder = head.renderOrder = 5;
      this.shafts.push(shaft);
      this.heads.push(head);
      this.node.add(shaft, head);
    }
    this.node.visible = false;
  }

  /** Show the arrow from `from` along `vector` [m], with this radius of the shaft [m]. */
  show(from: Vector3, vector: Vector3, radius: number): void {
    const length = vector.length();
    this.node.visible = length > 0;
    if (!this.node.visible) return;
    const head = Math.min(0.5 * length, 9 * radius);
    this.node.position.copy(from);
    this.node.quaternion.setFromUnitVectors(UP, this.way.copy(vector).divideScalar(length));
    for (const shaft of this.shafts) shaft.scale.set(radius, Math.max(1e-9, length - head), radius);
    for (const cone of this.heads) {
      cone.position.y = length - head;
      cone.scale.set(2.7 * radius, head, 2.7 * radius);
    }
  }

  hide(): void { this.node.visible = false; }
}

/** Scale of each kind of arrow, as value per metre. The first value of a kind sets it; a value whose arrow would leave
 * the picture sets it again. */
export class Scales {
  private readonly perMetre = new Map<string, number>();

  /** Length [m] of an arrow for a value >= 0. usual: sets the scale if the first value is negligible. */
  length(kind: string, value: number, first: number, longest: number, usual: number): number {
    if (!(value > 0) || !Number.isFinite(value)) return 0;
    let known = this.perMetre.get(kind) ?? (value > 1e-6 * usual ? value : usual) / first;
    if (value / known > longest) known = value / longest;
    this.perMetre.set(kind, known);
    const length = value / known;
    return length < 0.02 * longest ? 0 : length;
  }

  forget(): void { this.perMetre.clear(); }
}

const RINGS = 17, SIDES = 8;

/** The string from the hand to the knot, drawn on top, with a ball at each end. */
export class Cord {
  readonly node = new Group();
  private readonly tube: Mesh;
  private readonly ends: readonly [Mesh, Mesh];
  private readonly places = new Float32Array(3 * RINGS * SIDES);

  constructor(colour: number) {
    const material = new MeshLambertMaterial({ color: colour, emissive: colour, emissiveIntensity: 0.35, depthTest: false, transparent: true });
    const geometry = new BufferGeometry().setAttribute("position", new BufferAttribute(this.places, 3)), index: number[] = [];
    geometry.setAttribute("normal", new BufferAttribute(new Float32Array(this.places.length), 3));
    for (let r = 0; r + 1 < RINGS; r++) for (let s = 0; s < SIDES; s++) {
      const a = r * SIDES + s, b = r * SIDES + ((s + 1) % SIDES);
      index.push(a, b, a + SIDES, b, b + SIDES, a + SIDES);
    }
    geometry.setIndex(index);
    this.tube = new Mesh(geometry, material);
    this.tube.frustumCulled = false;
    this.ends = [new Mesh(BALL, material), new Mesh(BALL, material)];
    this.node.add(this.tube, ...this.ends);
    for (const part of [this.tube, ...this.ends]) part.renderOrder = 20;
    this.node.visible = false;
  }

  /** Show the string; with length restLength [m] it sags along `down` while it is slack. */
  show(hand: Vector3, knot: Vector3, restLength: number, down: Vector3, radius: number): void {
    this.node.visible = true;
    const span = hand.distanceTo(knot), curve = sag(span, restLength);
    const along = knot.clone().sub(hand).normalize(), side = new Vector3(), over = new Vector3(), centre = new Vector3();
    side.crossVectors(along, Math.abs(along.z) < 0.9 ? new Vector3(0, 0, 1) : new Vector3(1, 0, 0)).normalize();
    over.crossVectors(along, side);
    const normals = this.tube.geometry.attributes["normal"] as BufferAttribute;
    for (let r = 0; r < RINGS; r++) {
      const t = r / (RINGS - 1);
      centre.copy(hand).lerp(knot, t).addScaledVector(down, 4 * t * (1 - t) * curve);
      for (let s = 0; s < SIDES; s++) {
        const angle = (2 * Math.PI * s) / SIDES, c = Math.cos(angle), z = Math.sin(angle), k = r * SIDES + s;
        const nx = c * side.x + z * over.x, ny = c * side.y + z * over.y, nz = c * side.z + z * over.z;
        this.places[3 * k] = centre.x + radius * nx; this.places[3 * k + 1] = centre.y + radius * ny; this.places[3 * k + 2] = centre.z + radius * nz;
        normals.setXYZ(k, nx, ny, nz);
      }
    }
    (this.tube.geometry.attributes["position"] as BufferAttribute).needsUpdate = true;
    normals.needsUpdate = true;
    this.ends[0].position.copy(hand);
    this.ends[1].position.copy(knot);
    this.ends[0].scale.setScalar(3.4 * radius);
    this.ends[1].scale.setScalar(2.6 * radius);
  }

  hide(): void { this.node.visible = false; }
}

/** Sag of a parabola of this length whose ends are `span` apart; 0 if it is taut. */
function sag(span: number, length: number): number {
  if (!(length > span)) return 0;
  let low = 0, high = 0.6 * length;
  for (let k = 0; k < 30; k++) {
    const depth = 0.5 * (low + high), slope = (4 * depth) / Math.max(span, 1e-12);
    const arc = slope > 1e6 ? 2 * depth : 0.5 * span * (Math.sqrt(1 + slope * slope) + Math.asinh(slope) / slope);
    if (arc < length) low = depth; else high = depth;
  }
  return low;
}
