// The scene as the pages' scripts read it: what does not change while it plays. Internal to this module.
#pragma once

#include <nlohmann/json.hpp>
#include <span>

#include "smartsurf/scene/SceneSpec.h"

namespace smartsurf::web {

// `objects`: every object, index = id.
nlohmann::json scene_json(const scene::SceneSpec&, std::span<const scene::ObjectSpec> objects);

}  // namespace smartsurf::web
