// extension: the actuators and sensors of shared objects.
#include <algorithm>
#include <filesystem>
#include <string>

#include "smartsurf/scene/KindRegistry.h"
#include "smartsurf/script/ScriptContext.h"
#include "smartsurf/script/lua/SandboxFiles.h"
#include "smartsurf/script/lua/TableReader.h"

namespace smartsurf::script {
namespace {

bool is_loaded(const std::string& name) {
  const std::vector<scene::Extension> loaded = scene::loaded_extensions();
  return std::ranges::find(loaded, name, &scene::Extension::name) != loaded.end();
}

// extension 'belt.so': the script needs it. Native code is never loaded at a script's wish alone.
int require_extension(ScriptContext& context, lua_State* L) {
  require_loading(context, "extension");
  const std::string path = check_string(L, 1, "extension");
  const std::string name = std::filesystem::path(path).filename().string();
  if (!is_loaded(name)) {
    if (!context.options.load_extension)
      throw ScriptError("extension " + format_value(L, 1) +
                        ": is not loaded, and a script may not load native code: give --load " +
                        to_single_line(name) + " or --allow-extensions, or call load_extension()");
    context.options.load_extension(resolve_readable_path(context, "extension", path));
  }
  bind_actuators(L, name);
  bind_sensors(L, name);
  return 0;
}

}  // namespace

void bind_kind(lua_State* L, const std::string& name, lua_CFunction declare, const std::string& extension) {
  lua_pushglobaltable(L);
  lua_pushlstring(L, name.data(), name.size());
  if (lua_rawget(L, -2) != LUA_TNIL && lua_tocfunction(L, -1) != declare)
    throw ScriptError("the extension " + extension + " adds '" + name +
                      "', which is the name of something else already");
  if (lua_isnil(L, -1)) {
    lua_pushlstring(L, name.data(), name.size());
    lua_pushcclosure(L, declare, 1);
    lua_setfield(L, -3, name.c_str());
  }
  lua_pop(L, 2);
}

int bind_loaded_extensions(ScriptContext&, lua_State* L) {
  for (const scene::Extension& extension : scene::loaded_extensions()) {
    bind_actuators(L, extension.name);
    bind_sensors(L, extension.name);
  }
  return 0;
}

void bind_extensions(lua_State* L) { lua_register(L, "extension", guarded<require_extension>); }

}  // namespace smartsurf::script
