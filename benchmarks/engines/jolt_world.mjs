// SPDX-License-Identifier: MIT

/** A world of Jolt's without gravity, in one thread and one layer: {world, bodies}. */
export function emptyWorld(jolt) {
  const settings = new jolt.JoltSettings();
  settings.mMaxWorkerThreads = 0;
  const layers = new jolt.ObjectLayerPairFilterTable(1), broad = new jolt.BroadPhaseLayerInterfaceTable(1, 1);
  broad.MapObjectToBroadPhaseLayer(0, new jolt.BroadPhaseLayer(0));
  settings.mObjectLayerPairFilter = layers;
  settings.mBroadPhaseLayerInterface = broad;
  settings.mObjectVsBroadPhaseLayerFilter = new jolt.ObjectVsBroadPhaseLayerFilterTable(broad, 1, layers, 1);
  const world = new jolt.JoltInterface(settings), bodies = world.GetPhysicsSystem().GetBodyInterface();
  world.GetPhysicsSystem().SetGravity(new jolt.Vec3(0, 0, 0));
  return { world, bodies };
}
