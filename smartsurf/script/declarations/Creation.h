// Creates objects and joints, while the script loads or in the running simulation. Internal to this module.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "smartsurf/scene/SolidFactory.h"
#include "smartsurf/script/ScriptContext.h"

namespace smartsurf::script {

// The rule for labels of objects, for messages.
inline constexpr const char* kLabelRule = "at most 100 bytes in one line";
bool is_label(const std::string&);

// All throw ScriptError; `subject` begins its text.

// Prints the warnings with the script's location.
std::shared_ptr<const scene::Solid> make_solid(
    const ScriptContext&, lua_State*, const std::string& subject,
    const std::function<scene::SolidResult(scene::SolidFactory&)>& make);
// The object must be valid.
scene::ObjectId add_object(ScriptContext&, const std::string& subject, const scene::ObjectSpec&);
scene::JointId add_joint(ScriptContext&, const scene::JointSpec&);

}  // namespace smartsurf::script
