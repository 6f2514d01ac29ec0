// SPDX-License-Identifier: MIT
//
// The picture without WebGL, on a 2D canvas, by the painter's algorithm.

import { BackSide, GreaterDepth, LineBasicMaterial, LineSegments, Material, Mesh, MeshBasicMaterial, MeshLambertMaterial, FrontSide, Line, Points, Vector3, type BufferGeometry, type Object3D, type Scene } from "three";
import type { Eye } from "./picture_camera.ts";

const SUN = new Vector3(-0.35, -0.5, 1).normalize();
/** Largest number of triangles drawn; of a larger mesh only every n-th is drawn, to keep up with the frame rate. */
const MOST = 12_000;

interface Piece { readonly depth: number; readonly at: readonly number[]; readonly colour: string; readonly filled: boolean; readonly top: boolean }

export class FlatPicture {
  readonly canvas = document.createElement("canvas");
  private readonly paper: CanvasRenderingContext2D;

  constructor(stage: HTMLElement) {
    this.canvas.setAttribute("aria-hidden", "true");
    stage.prepend(this.canvas);
    this.paper = this.canvas.getContext("2d")!;
  }

  resize(width: number, height: number): void {
    this.canvas.width = width;
    this.canvas.height = height;
  }

  draw(eye: Eye, scene: Scene): void {
    const pieces: Piece[] = [];
    scene.updateMatrixWorld();
    scene.traverseVisible((node: Object3D) => {
      if (node instanceof Mesh) this.mesh(node as Mesh<BufferGeometry, Material>, eye, pieces);
      else if (node instanceof Line && !(node instanceof Points)) this.line(node as Line<BufferGeometry, Material>, eye, pieces);
    });
    pieces.sort((a, b) => Number(a.top) - Number(b.top) || b.depth - a.depth);
    const { paper } = this;
    paper.clearRect(0, 0, this.canvas.width, this.canvas.height);
    paper.lineWidth = 1;
    for (const { at, colour, filled } of pieces) {
      paper.beginPath();
      paper.moveTo(at[0]!, at[1]!);
      for (let k = 2; k < at.length; k += 2) paper.lineTo(at[k]!, at[k + 1]!);
      if (filled) { paper.fillStyle = colour; paper.fill(); }
      // The outline covers seams between neighbouring triangles.
      paper.strokeStyle = colour;
      paper.stroke();
    }
  }

  private places(node: Object3D, geometry: BufferGeometry, eye: Eye): { screen: Float64Array; world: Float64Array } {
    const position = geometry.getAttribute("position"), count = position.count, point = new Vector3(), seen = new Vector3();
    const screen = new Float64Array(3 * count), world = new Float64Array(3 * count);
    for (let k = 0; k < count; k++) {
      point.fromBufferAttribute(position, k).applyMatrix4(node.matrixWorld).toArray(world, 3 * k);
      eye.project(point, seen).toArray(screen, 3 * k);
    }
    return { screen, world };
  }

  private mesh(node: Mesh<BufferGeometry, Material>, eye: Eye, pieces: Piece[]): void {
    const { geometry, material } = node;
    if (!geometry.getAttribute("position") || material.depthFunc === GreaterDepth || material.stencilWrite || material.side === BackSide) return;
    if (!(material instanceof MeshLambertMaterial || material instanceof MeshBasicMaterial)) return;
    const { screen, world } = this.places(node, geometry, eye), index = geometry.getIndex(), corners = index?.count ?? screen.length / 3;
    const each = 3 * Math.max(1, Math.ceil(corners / 3 / MOST)), mirrored = node.matrixWorld.determinant() < 0 ? -1 : 1;
    const a = new Vector3(), b = new Vector3(), c = new Vector3();
    for (let k = 0; k < corners; k += each) {
      const [i, j, l] = index ? [index.getX(k), index.getX(k + 1), index.getX(k + 2)] : [k, k + 1, k + 2];
      const at = [screen[3 * i]!, screen[3 * i + 1]!, screen[3 * j]!, screen[3 * j + 1]!, screen[3 * l]!, screen[3 * l + 1]!];
      const turned = (at[2]! - at[0]!) * (at[5]! - at[1]!) - (at[3]! - at[1]!) * (at[4]! - at[0]!);
      if (material.side === FrontSide && turned * mirrored > 0) continue;
      a.fromArray(world, 3 * i); b.fromArray(world, 3 * j).sub(a); c.fromArray(world, 3 * l).sub(a);
      const light = b.cross(c).normalize().multiplyScalar(mirrored).dot(SUN), shade = 0.62 + 0.38 * Math.max(0, light) + 0.08 * Math.min(0, light);
      const { r, g, b: blue } = material.color.clone().multiplyScalar(shade * shade);
      pieces.push({ depth: (screen[3 * i + 2]! + screen[3 * j + 2]! + screen[3 * l + 2]!) / 3, at, colour: css(r, g, blue, material.opacity), filled: true, top: !material.depthTest });
    }
  }

  private line(node: Line<BufferGeometry, Material>, eye: Eye, pieces: Piece[]): void {
    const { geometry, material } = node;
    if (!geometry.getAttribute("position") || !(material instanceof LineBasicMaterial) || material.vertexColors) return;
    const { screen } = this.places(node, geometry, eye), pairs = node instanceof LineSegments;
    const count = Math.min(screen.length / 3, Number.isFinite(geometry.drawRange.count) ? geometry.drawRange.count : Infinity);
    const colour = css(material.color.r, material.color.g, material.color.b, material.opacity);
    for (let k = 0; k + 1 < count; k += pairs ? 2 : 1) {
      const at = [screen[3 * k]!, screen[3 * k + 1]!, screen[3 * k + 3]!, screen[3 * k + 4]!];
      pieces.push({ depth: 0.5 * (screen[3 * k + 2]! + screen[3 * k + 5]!), at, colour, filled: false, top: !material.depthTest });
    }
  }
}

/** The CSS colour of linear RGB. */
function css(r: number, g: number, b: number, alpha: number): string {
  const byte = (x: number): number => Math.round(255 * Math.min(1, Math.max(0, x)) ** (1 / 2.2));
  return `rgba(${byte(r)},${byte(g)},${byte(b)},${alpha})`;
}
