// The room on a flat canvas, for browsers without WebGL: the same scene, painted from the back to the front.

import * as THREE from "./vendor/three.min.js";

const LIGHT = new THREE.Vector3(0.3, 0.5, 1).normalize();

export class FlatRenderer {
  #projector = new THREE.Projector();
  #shade = new THREE.Color();

  constructor(canvas) {
    this.domElement = canvas;
    this.context = canvas.getContext("2d");
  }

  setSize(width, height, ratio) {
    Object.assign(this, { width, height, ratio });
    Object.assign(this.domElement, { width: Math.round(width * ratio), height: Math.round(height * ratio) });
  }

  render(scene, camera) {
    const { context, width, height, ratio } = this;
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.clearRect(0, 0, width, height);
    for (const element of this.#projector.projectScene(scene, camera, true, true).elements) {
      if (element instanceof THREE.RenderableFace) this.#face(element);
      else if (element instanceof THREE.RenderableLine) this.#line(element);
    }
    context.globalAlpha = 1;
  }

  #path(vertices) {
    const { context, width, height } = this;
    context.beginPath();
    vertices.forEach(({ positionScreen: { x, y } }, index) => {
      context[index ? "lineTo" : "moveTo"](((x + 1) / 2) * width, ((1 - y) / 2) * height);
    });
  }

  #face({ v1, v2, v3, normalModel, material }) {
    if (!material.color) return;
    this.#path([v1, v2, v3]);
    this.context.closePath();
    const light = material.isMeshBasicMaterial ? 1 : 0.55 + 0.45 * Math.abs(normalModel.dot(LIGHT));
    this.#shade.copy(material.color).multiplyScalar(light);
    this.context.globalAlpha = material.opacity;
    this.context.fillStyle = this.#shade.getStyle();
    if (material.wireframe) {
      this.context.strokeStyle = this.context.fillStyle;
      this.context.stroke();
    } else {
      this.context.fill();
    }
  }

  #line({ v1, v2, vertexColors, material }) {
    this.#path([v1, v2]);
    this.context.globalAlpha = material.opacity;
    this.context.strokeStyle = (material.vertexColors ? vertexColors[0] : material.color).getStyle();
    this.context.lineWidth = 1;
    this.context.stroke();
  }
}
