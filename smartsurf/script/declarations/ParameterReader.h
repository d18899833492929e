// Reads the parameters that an actuator or sensor kind declares from a Lua table. Internal to this module.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "smartsurf/scene/SensorSpec.h"
#include "smartsurf/script/lua/TableReader.h"

namespace smartsurf::script {

// The index of the string at `index` among `choices`. Throws ScriptError if it is none of them.
int check_choice(lua_State* L, int index, const std::string& name, const std::vector<std::string>& choices);

std::vector<std::string> parameter_names(std::span<const scene::Parameter>);

// Sets the values whose fields are present. Throws ScriptError for a value of the wrong type. Does not check
// ranges.
void read_parameters(lua_State* L, const TableReader&, std::span<const scene::Parameter>,
                     scene::ParameterValues&);

}  // namespace smartsurf::script
