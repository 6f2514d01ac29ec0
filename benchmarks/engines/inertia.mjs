// SPDX-License-Identifier: MIT
//
// What `rigid_proto inspect --for ENGINE` prints, taken by the engine itself: node inertia.mjs < JSON, which answers with
// JSON.
//
// Asked: {texts: {rapier, jolt, physx, havok, babylon}, glb, center, impulse, point, step_s, steps}: a body at rest whose
// axes are the world's gets an impulse [N s] at a point [m], and flies. glb: a flight's file (base64), whose body node Babylon's own
// loader reads; center [m]: the centre of mass. Answered by engine: {position, velocity, omega}, of the body's origin, of
// its centre of mass where the engine says that, and [rad/s], after the steps; or {why}.
//
// With {surface: {vertices, triangles}, mass}: also what each engine computes from the mesh by itself, by engine and
// shape, at that mass: {mass, center, tensor}, [kg], [m] and [kg m²] about the centre, six entries as URDF has them.
//
// Text in JavaScript is run as it stands; of text in C++ the numbers are taken by the names of the vectors that hold them.

import { createRequire } from "node:module";
import { readFileSync } from "node:fs";
import { emptyWorld } from "./jolt_world.mjs";

const packages = createRequire(import.meta.url);
const BALL = 0.01;
const xyz = ([x, y, z]) => ({ x, y, z });
const list = (v) => [v.x, v.y, v.z];
const listOf = (v) => [v.GetX(), v.GetY(), v.GetZ()];
const cross = ([a, b, c], [d, e, f]) => [b * f - c * e, c * d - a * f, a * e - b * d];
const minus = (a, b) => a.map((value, k) => value - b[k]);

/** Rows of numbers in parentheses after a name. */
const named = (text, name) => [...text.matchAll(new RegExp(`\\b${name}\\(([^()]*)\\)`, "g"))].map((match) => match[1].split(",").map(parseFloat));
const assigned = (text, name) => parseFloat(text.split(name)[1].replace(/^[^\d-]*/, ""));

/** Six entries of a tensor (principal moments, rotation x y z w), ixx ixy ixz iyy iyz izz. */
function six(moments, [x, y, z, w]) {
  const R = [
    [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
    [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
    [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
  ];
  const entry = (i, j) => moments.reduce((sum, moment, k) => sum + moment * R[i][k] * R[j][k], 0);
  return [entry(0, 0), entry(0, 1), entry(0, 2), entry(1, 1), entry(1, 2), entry(2, 2)];
}

const ENGINES = {
  async rapier({ texts, impulse, point, step_s, steps, surface, mass }) {
    const rapier = packages("@dimforge/rapier3d-compat");
    await rapier.init();
    const world = new rapier.World(xyz([0, 0, 0])), description = rapier.RigidBodyDesc.dynamic().setCanSleep(false);
    world.timestep = step_s;
    new Function("description", texts.rapier)(description);
    const body = world.createRigidBody(description);
    world.step(); // which takes the properties
    body.applyImpulseAtPoint(xyz(impulse), xyz(point), true);
    for (let k = 0; k < steps; k++) world.step();
    const flown = { position: list(body.translation()), omega: list(body.angvel()) };
    const own = {};
    if (surface) {
      const vertices = Float32Array.from(surface.vertices.flat()), triangles = Uint32Array.from(surface.triangles.flat());
      const shapes = { trimesh: () => rapier.ColliderDesc.trimesh(vertices, triangles), "convex hull": () => rapier.ColliderDesc.convexHull(vertices) };
      for (const [name, shape] of Object.entries(shapes)) {
        for (const [way, collider] of Object.entries({ "by density": shape().setDensity(1000), "by setMass": shape().setMass(mass) })) {
          const one = world.createRigidBody(rapier.RigidBodyDesc.dynamic());
          world.createCollider(collider, one);
          one.recomputeMassPropertiesFromColliders();
          world.step(); // which takes the properties
          const { m11, m12, m13, m22, m23, m33 } = one.effectiveAngularInertia(), scale = mass / one.mass();
          own[`${name} ${way}`] = { mass, center: list(one.localCom()), tensor: [m11, m12, m13, m22, m23, m33].map((value) => value * scale) };
        }
      }
    }
    return { ...flown, own };
  },

  async jolt({ texts, impulse, point, step_s, steps, surface, mass }) {
    const jolt = await (await import("jolt-physics")).default();
    const { world, bodies } = emptyWorld(jolt);
    const [center] = named(texts.jolt, "Vec3"), columns = named(texts.jolt, "Vec4").slice(0, 3);
    const moved = new jolt.OffsetCenterOfMassShapeSettings(new jolt.Vec3(...center), new jolt.SphereShapeSettings(BALL)).Create().Get();
    const about = new jolt.BodyCreationSettings(moved, new jolt.RVec3(0, 0, 0), new jolt.Quat(0, 0, 0, 1), jolt.EMotionType_Dynamic, 0);
    about.mOverrideMassProperties = jolt.EOverrideMassProperties_MassAndInertiaProvided;
    about.mMassPropertiesOverride.mMass = assigned(texts.jolt, "mMassPropertiesOverride.mMass");
    const tensor = jolt.Mat44.prototype.sIdentity();
    columns.forEach((column, k) => tensor.SetColumn4(k, new jolt.Vec4(...column)));
    about.mMassPropertiesOverride.mInertia = tensor;
    about.mAllowSleeping = false;
    about.mAngularDamping = about.mLinearDamping = 0;
    const body = bodies.CreateBody(about);
    bodies.AddBody(body.GetID(), jolt.EActivation_Activate);
    body.AddImpulse(new jolt.Vec3(...impulse), new jolt.RVec3(...point));
    for (let k = 0; k < steps; k++) world.Step(step_s, 1);
    const flown = { position: listOf(body.GetPosition()), velocity: listOf(body.GetLinearVelocity()), omega: listOf(body.GetAngularVelocity()) };
    const own = {};
    if (surface) {
      const hull = new jolt.ConvexHullShapeSettings();
      for (const vertex of surface.vertices) hull.mPoints.push_back(new jolt.Vec3(...vertex));
      const shape = hull.Create().Get(), found = shape.GetMassProperties(), scale = mass / found.mMass;
      const [x, y, z] = [0, 1, 2].map((k) => listOf(found.mInertia.GetColumn3(k)));
      own["convex hull"] = { mass, center: listOf(shape.GetCenterOfMass()), tensor: [...x, y[1], y[2], z[2]].map((value) => value * scale) };
    }
    return { ...flown, own };
  },

  async physx({ texts, impulse, point, step_s, steps, surface, mass }) {
    const wasmBinary = readFileSync(packages.resolve("physx-js-webidl/physx-js-webidl.wasm"));
    const px = await asInBrowser((await import("physx-js-webidl")).default, { wasmBinary }), top = px.PxTopLevelFunctions.prototype;
    const foundation = top.CreateFoundation(px.PHYSICS_VERSION, new px.PxDefaultAllocator(), new px.PxDefaultErrorCallback());
    const scale = new px.PxTolerancesScale(), physics = top.CreatePhysics(px.PHYSICS_VERSION, foundation, scale);
    const about = new px.PxSceneDesc(physics.getTolerancesScale());
    about.gravity = new px.PxVec3(0, 0, 0);
    about.cpuDispatcher = top.DefaultCpuDispatcherCreate(0);
    about.filterShader = top.DefaultFilterShader();
    const world = physics.createScene(about), body = physics.createRigidDynamic(new px.PxTransform(px.PxIDENTITYEnum.PxIdentity));
    const [center, moments] = named(texts.physx, "PxVec3"), [rotation] = named(texts.physx, "PxQuat");
    body.setMass(assigned(texts.physx, "setMass("));
    body.setCMassLocalPose(new px.PxTransform(new px.PxVec3(...center), new px.PxQuat(...rotation)));
    body.setMassSpaceInertiaTensor(new px.PxVec3(...moments));
    body.setAngularDamping(0);
    body.setSleepThreshold(0);
    world.addActor(body);
    body.addForce(new px.PxVec3(...impulse), px.PxForceModeEnum.eIMPULSE);
    body.addTorque(new px.PxVec3(...cross(minus(point, center), impulse)), px.PxForceModeEnum.eIMPULSE);
    for (let k = 0; k < steps; k++) {
      world.simulate(step_s);
      world.fetchResults(true);
    }
    const flown = { position: list(body.getGlobalPose().p), velocity: list(body.getLinearVelocity()), omega: list(body.getAngularVelocity()) };
    const own = {};
    if (surface) {
      const points = new px.PxArray_PxVec3(surface.vertices.length), about = new px.PxConvexMeshDesc();
      surface.vertices.forEach((vertex, k) => points.set(k, new px.PxVec3(...vertex)));
      about.points.count = surface.vertices.length;
      about.points.stride = 12;
      about.points.data = points.begin();
      about.flags = new px.PxConvexFlags(px.PxConvexFlagEnum.eCOMPUTE_CONVEX);
      const hull = top.CreateConvexMesh(new px.PxCookingParams(scale), about), one = physics.createRigidDynamic(new px.PxTransform(px.PxIDENTITYEnum.PxIdentity));
      one.attachShape(physics.createShape(new px.PxConvexMeshGeometry(hull), physics.createMaterial(0.5, 0.5, 0), true));
      px.PxRigidBodyExt.prototype.setMassAndUpdateInertia(one, mass);
      const pose = one.getCMassLocalPose();
      own["convex hull"] = { mass, center: list(pose.p), tensor: six(list(one.getMassSpaceInertiaTensor()), [pose.q.x, pose.q.y, pose.q.z, pose.q.w]) };
    }
    return { ...flown, own };
  },

  async babylon({ texts, impulse, point, step_s, steps }) {
    const { scene, step, asBody, Vector3, Quaternion, TransformNode } = await babylonWorld();
    const node = new TransformNode("body", scene), body = asBody(node);
    new Function("BABYLON", "body", texts.babylon)({ Vector3, Quaternion }, body);
    body.applyImpulse(Vector3.FromArray(impulse), Vector3.FromArray(point));
    for (let k = 0; k < steps; k++) step(step_s);
    return { position: node.position.asArray(), velocity: body.getLinearVelocity().asArray(), omega: body.getAngularVelocity().asArray(), own: {} };
  },

  async gltf({ glb, center, impulse, point, step_s, steps }) {
    const { scene, step, asBody, Vector3, Quaternion } = await babylonWorld();
    const { registerGLTFExtension } = await import("@babylonjs/loaders/glTF/2.0/glTFLoaderExtensionRegistry.js");
    const { ImportMeshAsync } = await import("@babylonjs/core/Loading/sceneLoader.js");
    await import("@babylonjs/loaders/glTF/2.0/glTFLoader.js");
    const name = "KHR_physics_rigid_bodies", motions = new Map();
    registerGLTFExtension(name, true, (loader) => ({
      name, enabled: true, dispose() {},
      loadNodeAsync(context, node, assign) {
        const motion = node.extensions?.[name]?.motion;
        return motion ? loader.loadNodeAsync(context, node, (made) => { motions.set(made.name, motion); assign(made); }) : null;
      },
    }));
    await ImportMeshAsync(`data:model/gltf-binary;base64,${glb}`, scene, { pluginExtension: ".glb" });
    for (const group of scene.animationGroups) group.stop();
    const node = scene.getNodeByName("body"), { mass, centerOfMass, inertiaDiagonal, inertiaOrientation } = motions.get("body");
    const body = asBody(node), moments = Vector3.FromArray(inertiaDiagonal).scale(1 / mass); // Babylon takes those of 1 kg
    body.setMassProperties({ mass, centerOfMass: Vector3.FromArray(centerOfMass), inertia: moments, inertiaOrientation: Quaternion.FromArray(inertiaOrientation) });
    // The file has y up: the world's axes here are those of its root.
    const up = node.parent.absoluteRotationQuaternion, turned = (v) => Vector3.FromArray(v).applyRotationQuaternion(up);
    const back = (v) => v.applyRotationQuaternion(Quaternion.Inverse(up)).asArray();
    body.applyImpulse(turned(impulse), turned(minus(point, center)));
    for (let k = 0; k < steps; k++) step(step_s);
    const origin = Vector3.TransformCoordinates(Vector3.FromArray(center).scale(-1), node.computeWorldMatrix(true)).add(turned(center));
    return { position: back(origin), velocity: back(body.getLinearVelocity()), omega: back(body.getAngularVelocity()), own: {} };
  },

  async bullet({ surface, mass }) {
    const own = {};
    if (surface) {
      const ammo = await packages("ammojs-typed/wasm")({ wasmBinary: readFileSync(packages.resolve("ammojs-typed/ammo.wasm.wasm")) });
      const hull = new ammo.btConvexHullShape(), tensor = new ammo.btVector3(0, 0, 0);
      hull.setMargin(0);
      for (const vertex of surface.vertices) hull.addPoint(new ammo.btVector3(...vertex), true);
      hull.calculateLocalInertia(mass, tensor);
      own["convex hull"] = { mass, center: [0, 0, 0], tensor: [tensor.x(), 0, 0, tensor.y(), 0, tensor.z()] };
    }
    return { own };
  },

  async cannon({ surface, mass }) {
    const own = {};
    if (surface) {
      const cannon = await import("cannon-es");
      const vertices = surface.vertices.map((vertex) => new cannon.Vec3(...vertex));
      const body = new cannon.Body({ mass, shape: new cannon.ConvexPolyhedron({ vertices, faces: surface.triangles }) });
      own.ConvexPolyhedron = { mass, center: [0, 0, 0], tensor: [body.inertia.x, 0, 0, body.inertia.y, 0, body.inertia.z] };
    }
    return { own };
  },

  async havok({ texts, impulse, point, step_s, steps, surface, mass }) {
    const havok = await havokModule();
    const done = ([result, value]) => {
      if (result !== havok.Result.RESULT_OK) throw new Error(`Havok refuses: ${String(result)}`);
      return value;
    };
    const world = done(havok.HP_World_Create()), body = done(havok.HP_Body_Create());
    havok.HP_World_SetGravity(world, [0, 0, 0]);
    havok.HP_World_SetIdealStepTime(world, step_s);
    havok.HP_Body_SetShape(body, done(havok.HP_Shape_CreateSphere([0, 0, 0], BALL)));
    havok.HP_Body_SetMotionType(body, havok.MotionType.DYNAMIC);
    new Function("havok", "body", texts.havok)(havok, body);
    havok.HP_Body_SetAngularDamping(body, 0);
    havok.HP_Body_SetLinearDamping(body, 0);
    havok.HP_Body_SetActivationControl(body, havok.ActivationControl.ALWAYS_ACTIVE);
    havok.HP_World_AddBody(world, body, false);
    havok.HP_Body_ApplyImpulse(body, point, impulse);
    for (let k = 0; k < steps; k++) havok.HP_World_Step(world, step_s);
    const flown = { position: done(havok.HP_Body_GetPosition(body)), velocity: done(havok.HP_Body_GetLinearVelocity(body)), omega: done(havok.HP_Body_GetAngularVelocity(body)) };
    const own = {};
    if (surface) {
      const bytes = new Float32Array(surface.vertices.flat()), at = havok._malloc(bytes.length * 4);
      new Float32Array(havok.HEAPU8.buffer, at, bytes.length).set(bytes);
      const hull = done(havok.HP_Shape_CreateConvexHull(at, surface.vertices.length));
      const [center, , moments, rotation] = done(havok.HP_Shape_BuildMassProperties(hull));
      own["convex hull"] = { mass, center, tensor: six(moments.map((moment) => moment * mass), rotation) };
    }
    return { ...flown, own };
  },
};

async function havokModule() {
  return (await import("@babylonjs/havok")).default({ wasmBinary: readFileSync(packages.resolve("@babylonjs/havok/lib/esm/HavokPhysics.wasm")) });
}

/** A scene of Babylon's without a screen, its physics Havok's: step(seconds), and asBody(node), a ball that nothing slows. */
async function babylonWorld() {
  const part = (path) => import(`@babylonjs/core/${path}.js`);
  const [{ NullEngine }, { Scene }, { Vector3, Quaternion }, { TransformNode }] = await Promise.all(["Engines/nullEngine", "scene", "Maths/math.vector", "Meshes/transformNode"].map(part));
  const [{ PhysicsBody }, { PhysicsShapeSphere }, { PhysicsMotionType }, { HavokPlugin }] = await Promise.all(["physicsBody", "physicsShape", "IPhysicsEnginePlugin", "Plugins/havokPlugin"].map((name) => part(`Physics/v2/${name}`)));
  await Promise.all(["Physics/joinedPhysicsEngineComponent", "Physics/v2/physicsEngineComponent"].map(part));
  const scene = new Scene(new NullEngine()), plugin = new HavokPlugin(true, await havokModule()), bodies = [];
  scene.useRightHandedSystem = true;
  scene.enablePhysics(Vector3.Zero(), plugin);
  const asBody = (node) => {
    const body = new PhysicsBody(node, PhysicsMotionType.DYNAMIC, false, scene);
    body.shape = new PhysicsShapeSphere(Vector3.Zero(), BALL, scene);
    body.setAngularDamping(0);
    body.setLinearDamping(0);
    bodies.push(body);
    return body;
  };
  return { scene, step: (seconds) => plugin.executeStep(seconds, bodies), asBody, Vector3, Quaternion, TransformNode };
}

/** Calls what is built for browsers alone, and refuses Node by its process; it uses no window. */
async function asInBrowser(make, options) {
  const node = Object.getOwnPropertyDescriptor(globalThis, "process");
  delete globalThis.process;
  globalThis.window = globalThis;
  try {
    return await make(options);
  } finally {
    Object.defineProperty(globalThis, "process", node);
    delete globalThis.window;
  }
}

console.log = console.info = console.error; // engines greet there
const asked = JSON.parse(readFileSync(0, "utf8")), found = {};
for (const [name, take] of Object.entries(ENGINES)) {
  try {
    found[name] = await take(asked);
  } catch (error) {
    found[name] = { why: String(error.stack ?? error).split("\n").slice(0, 3).join(" ") };
  }
}
await new Promise((written) => { process.stdout.write(JSON.stringify(found), written); });
process.exit(0); // some engines leave threads
