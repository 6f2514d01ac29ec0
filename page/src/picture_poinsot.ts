// SPDX-License-Identifier: MIT
//
// Poinsot's construction about the body: ellipsoid, plane, polhode, herpolhode, and the two cones.

import {
  BufferAttribute, BufferGeometry, CircleGeometry, DoubleSide, Group, Line, LineBasicMaterial, LineSegments, Matrix4, Mesh, MeshBasicMaterial, MeshLambertMaterial, Points,
  PointsMaterial, Quaternion, SphereGeometry, Vector3,
} from "three";
import type { Construction } from "./poinsot.ts";
import type { Vec3 } from "./source.ts";

const ELLIPSOID = 0x2f63ad, POLHODE = 0xb5890a, HERPOLHODE = 0xd1602a, PLANE = 0x7a45d1;
const MOST = 3000;
/** Radius of the plane, and spacing of its lines, in body sizes. */
const RADIUS = 0.75, CELL = 0.15;
const OUT = new Vector3(0, 0, 1);

/** A curve that is visible at any distance, and the cone from the centre through it. */
class Curve {
  readonly line: Line;
  readonly dots: Points;
  readonly cone: Mesh;
  private readonly places = new Float32Array(3 * (MOST + 1));
  private readonly attribute = new BufferAttribute(this.places, 3);

  constructor(colour: number, coneColour: number) {
    const curve = new BufferGeometry().setAttribute("position", this.attribute), fan = new BufferGeometry().setAttribute("position", this.attribute);
    fan.setIndex([...Array(MOST - 1).keys()].flatMap((k) => [0, k + 1, k + 2]));
    this.line = new Line(curve, new LineBasicMaterial({ color: colour, depthTest: false, transparent: true }));
    this.dots = new Points(curve, new PointsMaterial({ color: colour, size: 3, sizeAttenuation: false, depthTest: false, transparent: true }));
    this.cone = new Mesh(fan, new MeshBasicMaterial({ color: coneColour, transparent: true, opacity: 0.22, side: DoubleSide, depthWrite: false }));
    for (const part of [this.line, this.dots, this.cone]) part.frustumCulled = false;
    this.line.renderOrder = this.dots.renderOrder = 12;
    this.cone.renderOrder = 9;
  }

  show(points: readonly Vec3[], unit: number, cone: boolean): void {
    const count = Math.min(MOST, points.length);
    for (let k = 0; k < count; k++) for (let i = 0; i < 3; i++) this.places[3 * (k + 1) + i] = unit * points[k]![i]!;
    this.attribute.needsUpdate = true;
    this.line.geometry.setDrawRange(1, count);
    this.line.visible = count > 1;
    this.dots.visible = true;
    this.cone.geometry.setDrawRange(0, 3 * Math.max(0, count - 1));
    this.cone.visible = cone && count > 1;
  }
}

interface Wanted { readonly poinsot: boolean; readonly cones: boolean }

export class PoinsotPicture {
  /** Groups in body axes and in world axes, both with their origin at the centre of mass. */
  readonly onBody = new Group();
  readonly inSpace = new Group();
  private readonly ellipsoid = new Mesh(new SphereGeometry(1, 40, 26), new MeshLambertMaterial({ color: ELLIPSOID, transparent: true, opacity: 0.28, depthWrite: false }));
  private readonly plane = new Group();
  private readonly polhode = new Curve(POLHODE, POLHODE);
  private readonly herpolhode = new Curve(HERPOLHODE, PLANE);
  private readonly principal = new Group();

  constructor() {
    const disc = new Mesh(new CircleGeometry(RADIUS, 64), new MeshBasicMaterial({ color: PLANE, transparent: true, opacity: 0.1, side: DoubleSide, depthWrite: false }));
    this.plane.add(disc, rulings());
    this.ellipsoid.renderOrder = 8;
    this.principal.matrixAutoUpdate = false;
    this.principal.add(this.ellipsoid, this.polhode.line, this.polhode.dots, this.polhode.cone);
    this.onBody.add(this.principal);
    this.inSpace.add(this.plane, this.herpolhode.line, this.herpolhode.dots, this.herpolhode.cone);
    this.hide();
  }

  hide(): void { this.onBody.visible = this.inSpace.visible = false; }

  /** Show the construction. axes: 9 numbers row by row, principal axes as columns, in body axes; size: the body's [m];
   * at: the centre of mass [m, world]. */
  show(made: Construction, axes: readonly number[], herpolhode: readonly Vec3[], at: Vector3, size: number, { poinsot, cones }: Wanted): void {
    this.onBody.visible = this.inSpace.visible = true;
    this.ellipsoid.visible = this.plane.visible = poinsot;
    this.principal.matrix.copy(new Matrix4().set(axes[0]!, axes[1]!, axes[2]!, 0, axes[3]!, axes[4]!, axes[5]!, 0, axes[6]!, axes[7]!, axes[8]!, 0, 0, 0, 0, 1));
    this.ellipsoid.scale.set(...(made.semi as [number, number, number]));
    this.polhode.show(made.polhode, made.unit, cones);
    this.herpolhode.show(herpolhode, made.unit, cones);
    const upright = new Vector3(...made.upright);
    this.inSpace.position.copy(at);
    this.plane.position.copy(upright).multiplyScalar(made.depth);
    this.plane.quaternion.copy(new Quaternion().setFromUnitVectors(OUT, upright));
    this.plane.scale.setScalar(size);
  }
}

/** The grid of the plane, within its rim. */
function rulings(): LineSegments {
  const places: number[] = [];
  for (let s = -RADIUS + CELL; s < RADIUS - 1e-9; s += CELL) {
    const half = Math.sqrt(RADIUS * RADIUS - s * s);
    places.push(s, -half, 0, s, half, 0, -half, s, 0, half, s, 0);
  }
  return new LineSegments(new BufferGeometry().setAttribute("position", new BufferAttribute(new Float32Array(places), 3)), new LineBasicMaterial({ color: PLANE, transparent: true, opacity: 0.3 }));
}
