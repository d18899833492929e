#include "smartsurf/world/bullet/EngineFactory.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numbers>

#include "smartsurf/world/NativeEngine.h"
#ifdef SMARTSURF_BULLET
#include "smartsurf/world/bullet/BulletEngine.h"
#endif

namespace smartsurf::world {

#ifdef SMARTSURF_BULLET
bool has_bullet() { return true; }
#else
bool has_bullet() { return false; }
#endif

void require_joint(const std::string& engine, const scene::JointSpec& joint) {
  if (engine != "bullet" || joint.kind != scene::JointKind::kHinge || !joint.limits) return;
  const auto is_beyond = [](double limit) {
    return std::isfinite(limit) && std::abs(limit) > std::numbers::pi;
  };
  if (is_beyond(joint.limits->lower) || is_beyond(joint.limits->upper))
    throw scene::InputError(
        fmt::format("limits = {{{}, {}}}: a hinge's must be within half a turn, [-pi, pi], on the engine "
                    "'bullet'; use the "
                    "engine 'native'",
                    joint.limits->lower, joint.limits->upper));
}

void require_engine(const scene::SceneSpec& scene) {
  if (std::ranges::find(scene::kEngineNames, scene.world.engine) == std::end(scene::kEngineNames))
    throw scene::InputError("engine '" + scene.world.engine + "': this version does not have it");
  if (scene.world.engine != "bullet") return;
  if (!has_bullet())
    throw scene::InputError(
        "engine 'bullet': this build has no Bullet; install libbullet-dev (scripts/setup) and build again");
  if (scene.surface.skin)
    throw scene::InputError("engine 'bullet': has no skins; remove surface.skin, or use the engine 'native'");
  for (std::size_t i = 0; i < scene.joints.size(); ++i) try {
      require_joint(scene.world.engine, scene.joints[i]);
    } catch (const scene::InputError& error) {
      throw scene::InputError(fmt::format("joint {}: {}", i, error.what()));
    }
  for (const scene::ActuatorSpec& actuator : scene.surface.effective_actuators()) {
    if (actuator.model == "pin" && actuator.has("stiffness"))
      throw scene::InputError(
          "engine 'bullet': has rigid pins only; remove pin.stiffness, or use the engine 'native'");
    if (actuator.model == "delta" && (actuator.has("stiffness") || actuator.has("max_force")))
      throw scene::InputError(
          "engine 'bullet': has rigid tips only; remove delta.stiffness and delta.max_force, or use the "
          "engine 'native'");
  }
}

std::unique_ptr<Engine> make_engine(const scene::SceneSpec& scene, surface::Field& field,
                                    common::ThreadPool* pool) {
  require_engine(scene);
#ifdef SMARTSURF_BULLET
  if (scene.world.engine == "bullet") return std::make_unique<BulletEngine>(scene, field, pool);
#endif
  return std::make_unique<NativeEngine>(scene, field, pool);
}

}  // namespace smartsurf::world
