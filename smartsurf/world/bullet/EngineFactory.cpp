#include "smartsurf/world/bullet/EngineFactory.h"

#include <fmt/format.h>

#include <algorithm>
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

std::string validate_for_engine(const scene::JointSpec& joint, const std::string& engine) {
  if (engine != "bullet" || joint.kind != scene::JointKind::kHinge || !joint.limits) return {};
  const auto [lower, upper] = *joint.limits;
  if (-std::numbers::pi <= lower && upper <= std::numbers::pi) return {};
  return fmt::format(
      "limits = {{{}, {}}}: a hinge's must be within half a turn, [-pi, pi], on the engine "
      "'bullet'; use the engine 'native'",
      lower, upper);
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
  for (std::size_t i = 0; i < scene.joints.size(); ++i)
    if (const std::string error = validate_for_engine(scene.joints[i], scene.world.engine); !error.empty())
      throw scene::InputError(fmt::format("joint {}: {}", i, error));
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
