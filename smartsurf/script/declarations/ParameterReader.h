// Reads the parameters of an actuator or sensor from a Lua table, as its kind declares them. Internal to this
// module.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "smartsurf/scene/SensorSpec.h"
#include "smartsurf/script/lua/TableReader.h"

namespace smartsurf::script {

std::vector<std::string> parameter_names(std::span<const scene::Parameter>);

// Sets those values whose fields are there. Throws Problem for a value of the wrong type; ranges are not
// looked at.
void read_parameters(lua_State* L, const TableReader&, std::span<const scene::Parameter>,
                     scene::ParameterValues&);

}  // namespace smartsurf::script
