// SPDX-License-Identifier: MIT
//
// The camera: it orbits a target that follows the body, and frames it in the uncovered part of the window. z is up.

import { PerspectiveCamera, Vector3 } from "three";
import type { Vec3 } from "./source.ts";

/** Distance of the camera in framed radii, so large that perspective is weak. */
const FAR_RADII = 4.2;
/** [s] Time constant with which the target follows the body. */
const FOLLOWS_S = 0.35;
/** Largest distance of the body from the target, in framed radii. */
const STRAY = 0.3;
const HIGHEST = 1.5;
const FIRST = { azimuth: -0.84, elevation: 0.4 };

export interface Free { readonly left: number; readonly top: number; readonly width: number; readonly height: number }

export class Eye {
  readonly camera = new PerspectiveCamera(30, 1, 0.01, 100);
  readonly target = new Vector3();
  width = 1;
  height = 1;
  private free: Free = { left: 0, top: 0, width: 1, height: 1 };
  private azimuth = FIRST.azimuth;
  private elevation = FIRST.elevation;
  private zoom = 1;
  private radius = 1;
  /** The framed radius, smoothed. */
  private shownRadius = 0;

  constructor() { this.camera.up.set(0, 0, 1); }

  fit(width: number, height: number, free: Free): void {
    this.width = Math.max(1, width);
    this.height = Math.max(1, height);
    this.free = free;
  }

  /** Set the radius [m] of the sphere about the target that is framed. */
  frame(radius: number): void {
    this.radius = radius;
    if (!this.shownRadius) this.shownRadius = radius;
  }

  turn(dx: number, dy: number): void {
    this.azimuth -= dx * 0.0065;
    this.elevation = Math.max(-HIGHEST, Math.min(HIGHEST, this.elevation + dy * 0.0065));
  }

  near(factor: number): void { this.zoom = Math.max(0.15, Math.min(8, this.zoom * factor)); }

  home(): void {
    this.azimuth = FIRST.azimuth;
    this.elevation = FIRST.elevation;
    this.zoom = 1;
  }

  jump(to: Vec3): void {
    this.target.set(...to);
    this.shownRadius = 0;
  }

  follow(to: Vector3, seconds: number): void {
    const part = 1 - Math.exp(-seconds / FOLLOWS_S);
    this.target.lerp(to, part);
    const away = this.target.distanceTo(to), most = STRAY * this.radius;
    if (away > most) this.target.lerp(to, 1 - most / away);
  }

  /** Update the camera, `seconds` after the previous frame. */
  place(seconds: number): void {
    this.shownRadius += (this.radius - this.shownRadius) * (1 - Math.exp(-seconds / 0.2));
    const { camera, free, width, height } = this, half = Math.max(20, 0.5 * Math.min(free.width, free.height));
    const focal = half * Math.sqrt(FAR_RADII * FAR_RADII - 1), away = (this.shownRadius * FAR_RADII) / this.zoom;
    camera.fov = (2 * Math.atan((0.5 * height) / focal) * 180) / Math.PI;
    camera.aspect = width / height;
    camera.near = Math.max(away * 0.02, away - 12 * this.shownRadius);
    camera.far = away + 40 * this.shownRadius;
    const level = Math.cos(this.elevation);
    camera.position.set(Math.cos(this.azimuth) * level, Math.sin(this.azimuth) * level, Math.sin(this.elevation)).multiplyScalar(away).add(this.target);
    camera.lookAt(this.target);
    const middleX = free.left + 0.5 * free.width, middleY = free.top + 0.5 * free.height;
    camera.setViewOffset(width, height, 0.5 * width - middleX, 0.5 * height - middleY, width, height);
    camera.updateMatrixWorld();
  }

  /** Screen position [px] of a world point; z is its depth in normalized device coordinates. */
  project(point: Vector3, into: Vector3): Vector3 {
    into.copy(point).project(this.camera);
    return into.set((0.5 + 0.5 * into.x) * this.width, (0.5 - 0.5 * into.y) * this.height, into.z);
  }

  /** The ray through a screen position [px]; its direction is a unit vector. */
  ray(x: number, y: number): { origin: Vec3; direction: Vec3 } {
    const at = new Vector3((2 * x) / this.width - 1, 1 - (2 * y) / this.height, 0.5).unproject(this.camera).sub(this.camera.position).normalize();
    return { origin: this.camera.position.toArray(), direction: at.toArray() };
  }

  /** Depth of a point along the camera's axis [m]. */
  depth(point: Vec3): number {
    return new Vector3(...point).sub(this.camera.position).dot(this.camera.getWorldDirection(new Vector3()));
  }

  /** The world point at a screen position [px] and depth [m]. */
  at(x: number, y: number, depth: number): Vec3 {
    const { origin, direction } = this.ray(x, y), way = new Vector3(...direction);
    const along = depth / way.dot(this.camera.getWorldDirection(new Vector3()));
    return way.multiplyScalar(along).add(new Vector3(...origin)).toArray();
  }

  /** Unit vector towards the right of the screen [world]. */
  right(): Vec3 { return new Vector3().setFromMatrixColumn(this.camera.matrixWorld, 0).toArray(); }

  /** Metres per pixel at the target. */
  get perPixel(): number {
    const half = Math.max(20, 0.5 * Math.min(this.free.width, this.free.height));
    return this.camera.position.distanceTo(this.target) / (half * Math.sqrt(FAR_RADII * FAR_RADII - 1));
  }
}
