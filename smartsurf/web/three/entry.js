// The parts of three.js that the pages use (table.js, mechanisms.js).
export {
  AlwaysStencilFunc, BoxGeometry, BufferGeometry, CanvasTexture, CapsuleGeometry, Color, ConeGeometry, CylinderGeometry,
  DirectionalLight, DoubleSide, EqualStencilFunc, Float32BufferAttribute, Group, HemisphereLight, IncrementStencilOp,
  InstancedBufferAttribute, InstancedMesh, InterleavedBuffer, InterleavedBufferAttribute, Matrix4, Mesh, MeshBasicMaterial,
  MeshLambertMaterial, MeshStandardMaterial, PCFSoftShadowMap, PerspectiveCamera, Plane, PlaneGeometry, Quaternion, Raycaster,
  RepeatWrapping, SRGBColorSpace, Scene, SphereGeometry, Vector2, Vector3, WebGLRenderer,
} from 'three';
export { OrbitControls } from './package/examples/jsm/controls/OrbitControls.js';
