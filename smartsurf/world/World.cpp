#include "smartsurf/world/World.h"

#include <utility>

#include "smartsurf/world/NativeEngine.h"

namespace smartsurf::world {

World::World(const scene::SceneSpec& scene, std::unique_ptr<Engine> engine) : engine_(std::move(engine)) {
  for (const auto& object : scene.objects) add(object);
  for (const auto& joint : scene.joints) add_joint(joint);
}

World::World(const scene::SceneSpec& scene, surface::Field& field, common::ThreadPool* pool)
    : World(scene, std::make_unique<NativeEngine>(scene, field, pool)) {}

}  // namespace smartsurf::world
