// SPDX-License-Identifier: MIT
//
// One free body in the physics engines that npm has: node engines.mjs < JSON, which answers with JSON.
//
// Asked: {body: {mass, moments, rotation, omega}, steps_s: [..], duration_s, every_s}; rotation: principal axes in body
// axes, x y z w; omega [rad/s]: at the start, when body and world axes are the same. Answered, for each way of each engine
// and each step: {engine, package, version, way, step_s, states: [[qx, qy, qz, qw, wx, wy, wz], ..]}, omega in world axes, every
// every_s from the start on; or {engine, way, step_s, why} where it can't be had.
//
// An engine is {name, package, ways: {name: options}, load}: load() gives make(body, step_s, options), which gives
// {step(), state()}. Damping, which several engines have as they come, is off, and so is falling asleep; whatever else
// isn't named in a way is as it comes.

import { createRequire } from "node:module";
import { readFileSync } from "node:fs";
import { emptyWorld } from "./jolt_world.mjs";

const packages = createRequire(import.meta.url);
const BALL = 0.1;
/** [m] radius of the shape of a body, which touches nothing; some engines fly none without a shape. */
const FASTEST = 1e4;
/** [rad/s] where an engine limits the spin, 7 in PhysX and 47 in Jolt as they come. */

const isIdentity = ([x, y, z]) => x === 0 && y === 0 && z === 0;
const withoutAxes = (name, { rotation }) => {
  if (!isIdentity(rotation)) throw new Error(`${name} takes moments about the axes of the body alone`);
};

export const ENGINES = [
  {
    name: "MuJoCo",
    package: "@mujoco/mujoco",
    ways: { "Euler, as it comes": { integrator: "Euler" }, implicitfast: { integrator: "implicitfast" }, RK4: { integrator: "RK4" } },
    async load() {
      const mujoco = await (await import("@mujoco/mujoco")).default();
      return ({ mass, moments, rotation: [x, y, z, w], omega }, step_s, { integrator }) => {
        const model = mujoco.MjModel.from_xml_string(`<mujoco><option gravity="0 0 0" timestep="${step_s}" integrator="${integrator}"/>
          <worldbody><body><freejoint/><inertial mass="${mass}" pos="0 0 0" quat="${w} ${x} ${y} ${z}" diaginertia="${moments.join(" ")}"/></body></worldbody></mujoco>`);
        const data = new mujoco.MjData(model);
        data.qvel.set([0, 0, 0, ...omega]);
        return {
          step: () => mujoco.mj_step(model, data),
          state: () => {
            const [, , , qw, qx, qy, qz] = data.qpos, q = [qx, qy, qz, qw];
            return [...q, ...turned(q, [...data.qvel].slice(3, 6))];
          },
        };
      };
    },
  },
  {
    name: "Rapier",
    package: "@dimforge/rapier3d-compat",
    ways: { "as it comes": {} },
    async load() {
      const rapier = packages("@dimforge/rapier3d-compat");
      await rapier.init();
      return ({ mass, moments, rotation, omega }, step_s) => {
        const world = new rapier.World(xyz([0, 0, 0]));
        world.timestep = step_s;
        const about = rapier.RigidBodyDesc.dynamic().setAdditionalMassProperties(mass, xyz([0, 0, 0]), xyz(moments), xyzw(rotation));
        const body = world.createRigidBody(about.setAngvel(xyz(omega)).setCanSleep(false));
        return { step: () => world.step(), state: () => stateOf(body.rotation(), body.angvel()) };
      };
    },
  },
  {
    name: "Jolt",
    package: "jolt-physics",
    ways: { "as it comes": { gyroscopic: false }, "gyroscopic force on": { gyroscopic: true } },
    async load() {
      const jolt = await (await import("jolt-physics")).default();
      return ({ mass, moments, rotation, omega }, step_s, { gyroscopic }) => {
        withoutAxes("this way of Jolt", { rotation });
        const { world, bodies } = emptyWorld(jolt);
        const about = new jolt.BodyCreationSettings(new jolt.SphereShape(BALL), new jolt.RVec3(0, 0, 0), new jolt.Quat(0, 0, 0, 1), jolt.EMotionType_Dynamic, 0);
        const [x, y, z] = moments;
        about.mOverrideMassProperties = jolt.EOverrideMassProperties_MassAndInertiaProvided;
        about.mMassPropertiesOverride.mMass = mass;
        about.mMassPropertiesOverride.mInertia = jolt.Mat44.prototype.sScaleVec3(new jolt.Vec3(x, y, z));
        about.mAngularDamping = 0;
        about.mMaxAngularVelocity = FASTEST;
        about.mAllowSleeping = false;
        about.mApplyGyroscopicForce = gyroscopic;
        const body = bodies.CreateBody(about);
        bodies.AddBody(body.GetID(), jolt.EActivation_Activate);
        body.SetAngularVelocity(new jolt.Vec3(...omega));
        return {
          step: () => world.Step(step_s, 1),
          state: () => {
            const q = body.GetRotation(), w = body.GetAngularVelocity();
            return [q.GetX(), q.GetY(), q.GetZ(), q.GetW(), w.GetX(), w.GetY(), w.GetZ()];
          },
        };
      };
    },
  },
  {
    name: "Havok",
    package: "@babylonjs/havok",
    ways: { "as it comes": {} },
    async load() {
      const wasmBinary = readFileSync(packages.resolve("@babylonjs/havok/lib/esm/HavokPhysics.wasm"));
      const havok = await (await import("@babylonjs/havok")).default({ wasmBinary });
      const done = ([result, value]) => {
        if (result !== havok.Result.RESULT_OK) throw new Error(`Havok refuses: ${String(result)}`);
        return value;
      };
      return ({ mass, moments, rotation, omega }, step_s) => {
        const world = done(havok.HP_World_Create()), body = done(havok.HP_Body_Create());
        havok.HP_World_SetGravity(world, [0, 0, 0]);
        havok.HP_World_SetIdealStepTime(world, step_s);
        havok.HP_World_SetSpeedLimit(world, FASTEST, FASTEST);
        havok.HP_Body_SetShape(body, done(havok.HP_Shape_CreateSphere([0, 0, 0], BALL)));
        havok.HP_Body_SetMotionType(body, havok.MotionType.DYNAMIC);
        done([havok.HP_Body_SetMassProperties(body, [[0, 0, 0], mass, moments.map((moment) => moment / mass), rotation]), 0]);
        havok.HP_Body_SetAngularDamping(body, 0);
        havok.HP_Body_SetActivationControl(body, havok.ActivationControl.ALWAYS_ACTIVE);
        havok.HP_World_AddBody(world, body, false);
        havok.HP_Body_SetAngularVelocity(body, omega);
        return {
          step: () => havok.HP_World_Step(world, step_s),
          state: () => [...done(havok.HP_Body_GetOrientation(body)), ...done(havok.HP_Body_GetAngularVelocity(body))],
        };
      };
    },
  },
  {
    name: "PhysX",
    package: "physx-js-webidl",
    ways: { "as it comes": { flags: 0 }, "gyroscopic forces on": { flags: 1 << 10 } },
    async load() {
      const wasmBinary = readFileSync(packages.resolve("physx-js-webidl/physx-js-webidl.wasm"));
      const px = await asInBrowser((await import("physx-js-webidl")).default, { wasmBinary }), top = px.PxTopLevelFunctions.prototype;
      const foundation = top.CreateFoundation(px.PHYSICS_VERSION, new px.PxDefaultAllocator(), new px.PxDefaultErrorCallback());
      const physics = top.CreatePhysics(px.PHYSICS_VERSION, foundation, new px.PxTolerancesScale());
      return ({ mass, moments, rotation, omega }, step_s, { flags }) => {
        const about = new px.PxSceneDesc(physics.getTolerancesScale());
        about.gravity = new px.PxVec3(0, 0, 0);
        about.cpuDispatcher = top.DefaultCpuDispatcherCreate(0);
        about.filterShader = top.DefaultFilterShader();
        const world = physics.createScene(about), body = physics.createRigidDynamic(new px.PxTransform(px.PxIDENTITYEnum.PxIdentity));
        body.setMass(mass);
        body.setMassSpaceInertiaTensor(new px.PxVec3(...moments));
        body.setCMassLocalPose(new px.PxTransform(new px.PxVec3(0, 0, 0), new px.PxQuat(...rotation)));
        body.setAngularDamping(0);
        body.setMaxAngularVelocity(FASTEST);
        body.setSleepThreshold(0);
        if (flags) body.setRigidBodyFlag(flags, true);
        body.setAngularVelocity(new px.PxVec3(...omega), true);
        world.addActor(body);
        return {
          step: () => { world.simulate(step_s); world.fetchResults(true); },
          state: () => stateOf(body.getGlobalPose().q, body.getAngularVelocity()),
        };
      };
    },
  },
  {
    name: "Bullet (ammo)",
    package: "ammojs-typed",
    ways: { "as it comes": { flags: 0 }, "gyroscopic force on": { flags: 2 } }, // of Bullet 2.82, which ammo.js holds
    async load() {
      const ammo = await packages("ammojs-typed/wasm")({ wasmBinary: readFileSync(packages.resolve("ammojs-typed/ammo.wasm.wasm")) });
      return ({ mass, moments, rotation, omega }, step_s, { flags }) => {
        withoutAxes("Bullet", { rotation });
        const configuration = new ammo.btDefaultCollisionConfiguration(), vector = (v) => new ammo.btVector3(...v);
        const world = new ammo.btDiscreteDynamicsWorld(new ammo.btCollisionDispatcher(configuration), new ammo.btDbvtBroadphase(), new ammo.btSequentialImpulseConstraintSolver(), configuration);
        world.setGravity(vector([0, 0, 0]));
        const about = new ammo.btRigidBodyConstructionInfo(mass, new ammo.btDefaultMotionState(), new ammo.btSphereShape(BALL), vector(moments));
        const body = new ammo.btRigidBody(about);
        if (flags) body.setFlags(flags);
        body.setActivationState(4); // DISABLE_DEACTIVATION
        body.setAngularVelocity(vector(omega));
        world.addRigidBody(body);
        return {
          step: () => world.stepSimulation(step_s, 0),
          state: () => {
            const q = body.getWorldTransform().getRotation(), w = body.getAngularVelocity();
            return [q.x(), q.y(), q.z(), q.w(), w.x(), w.y(), w.z()];
          },
        };
      };
    },
  },
  {
    name: "cannon-es",
    package: "cannon-es",
    ways: { "as it comes": {} },
    async load() {
      const cannon = await import("cannon-es");
      return ({ mass, moments, rotation, omega }, step_s) => {
        withoutAxes("cannon-es", { rotation });
        const world = new cannon.World(), body = new cannon.Body({ mass, angularDamping: 0 });
        body.updateMassProperties();
        body.inertia.set(...moments);
        body.invInertia.set(...moments.map((moment) => 1 / moment));
        body.updateInertiaWorld(true);
        body.angularVelocity.set(...omega);
        world.addBody(body);
        return { step: () => world.step(step_s), state: () => stateOf(body.quaternion, body.angularVelocity) };
      };
    },
  },
];

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

const xyz = ([x, y, z]) => ({ x, y, z });
const xyzw = ([x, y, z, w]) => ({ x, y, z, w });
const stateOf = (q, w) => [q.x, q.y, q.z, q.w, w.x, w.y, w.z];

/** R(q) v. */
function turned([x, y, z, w], [a, b, c]) {
  const p = 2 * (y * c - z * b), q = 2 * (z * a - x * c), r = 2 * (x * b - y * a);
  return [a + w * p + y * r - z * q, b + w * q + z * p - x * r, c + w * r + x * q - y * p];
}

/** The version that is installed. */
function versionOf(name) {
  const root = new URL(`node_modules/${name}/package.json`, import.meta.url);
  return JSON.parse(readFileSync(root, "utf8")).version;
}

/** All ways of all engines with one body. */
export async function flown({ body, steps_s, duration_s, every_s }) {
  const rows = [];
  for (const { name: engine, package: from, ways, load } of ENGINES) {
    let make, version = "", why = "";
    try {
      version = versionOf(from);
      make = await load();
    } catch (error) {
      why = String(error.message ?? error).split("\n")[0];
    }
    for (const [way, options] of Object.entries(ways)) {
      for (const step_s of steps_s) {
        const row = { engine, package: from, version, way, step_s };
        try {
          if (!make) throw new Error(why);
          const one = make(body, step_s, options), each = Math.round(every_s / step_s), states = [one.state()];
          for (let k = 1; k <= Math.round(duration_s / step_s); k++) {
            one.step();
            if (k % each === 0) states.push(one.state());
          }
          rows.push({ ...row, states });
        } catch (error) {
          rows.push({ ...row, why: String(error.message ?? error).split("\n")[0] });
        }
      }
    }
  }
  return rows;
}

if (process.argv[1] === new URL(import.meta.url).pathname) {
  console.log = console.info = console.error; // engines greet there
  const rows = await flown(JSON.parse(readFileSync(0, "utf8")));
  await new Promise((written) => { process.stdout.write(JSON.stringify(rows), written); });
  process.exit(0); // some engines leave threads
}
