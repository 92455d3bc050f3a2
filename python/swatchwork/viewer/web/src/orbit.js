// SPDX-FileCopyrightText: Swatchwork contributors
// SPDX-License-Identifier: MIT

// The camera that a person turns about the object, by mouse, touch or keys.

import { PerspectiveCamera, Spherical, Quaternion, Vector3 } from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";

export class Orbit {
  constructor(canvas, head, moved) {
    this.centre = new Vector3(...head.centre);
    this.radius = head.radius;
    this.camera = new PerspectiveCamera(30, 1, 0.01, 100);
    this.camera.up.set(...head.up);
    const first = head.shots[0]?.camera.pose, up = this.camera.up;
    const side = Math.abs(up.x) > 0.5 ? new Vector3(0, 1, 0) : new Vector3(1, 0, 0);
    this.start = first
      ? new Vector3(first[0][3], first[1][3], first[2][3]).sub(this.centre)
      : side.multiplyScalar(0.8).addScaledVector(up, 0.35).add(new Vector3().crossVectors(up, side));
    this.controls = new OrbitControls(this.camera, canvas);
    Object.assign(this.controls, { enableDamping: false, minDistance: 1.15 * this.radius, maxDistance: 20 * this.radius, zoomToCursor: false });
    this.#place(this.start);
    this.controls.addEventListener("change", moved);
  }

  #place(direction) {
    this.controls.target.copy(this.centre);
    this.camera.position.copy(this.centre).addScaledVector(direction.clone().normalize(), 4.2 * this.radius);
    this.controls.update();
  }

  /** Where it was at first. */
  reset() {
    this.#place(this.start);
  }

  /** On from another camera's place, towards the object's middle. */
  from(pose) {
    this.controls.target.copy(this.centre);
    this.camera.position.setFromMatrixPosition(pose);
    this.controls.update();
  }

  pose() {
    this.camera.updateMatrixWorld();
    return this.camera.matrixWorld;
  }

  /** Turn by angles about the up axis and towards it, and come nearer by a factor. */
  turn(sideways, upwards, nearer = 1) {
    const upright = new Quaternion().setFromUnitVectors(this.camera.up, new Vector3(0, 1, 0));
    const offset = this.camera.position.clone().sub(this.controls.target).applyQuaternion(upright);
    const place = new Spherical().setFromVector3(offset);
    place.theta += sideways;
    place.phi -= upwards;
    place.radius = Math.min(this.controls.maxDistance, Math.max(this.controls.minDistance, place.radius / nearer));
    place.makeSafe();
    this.camera.position.copy(new Vector3().setFromSpherical(place).applyQuaternion(upright.invert())).add(this.controls.target);
    this.controls.update();
  }
}
