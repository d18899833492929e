// require, dofile and io of a sandboxed script: it reads beside itself and in the output folder, and writes
// in the output folder only. Symbolic links are followed before the place is judged.
#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>

#include "smartsurf/script/Fields.h"
#include "smartsurf/script/Files.h"
#include "smartsurf/script/Session.h"

namespace smartsurf::script {
namespace fs = std::filesystem;
namespace {

constexpr std::uintmax_t kLargestScript = 16u << 20;
constexpr const char* kModules = "smartsurf.modules";

bool is_within(const fs::path& path, const fs::path& folder) {
  const auto [f, p] = std::mismatch(folder.begin(), folder.end(), path.begin(), path.end());
  return f == folder.end() || (std::next(f) == folder.end() && f->empty());
}

fs::path resolved(const fs::path& path) {
  std::error_code error;
  const fs::path real = fs::weakly_canonical(path, error);
  return error ? fs::path() : real;
}

[[noreturn]] void refuse(const std::string& what, const std::string& path, const std::string& rule) {
  throw Problem(what + ": '" + one_line(path) + "' " + rule);
}

fs::path writable(const Session& session, const std::string& what, const std::string& path) {
  if (session.options.output_folder.empty())
    refuse(what, path, "cannot be written: this run has no output folder");
  const fs::path output = resolved(session.options.output_folder), real = resolved(output / path);
  if (real.empty() || output.empty() || !is_within(real, output))
    refuse(what, path, "is outside the output folder; --unsafe allows it");
  std::error_code error;
  if (fs::exists(real, error) && !fs::is_regular_file(real, error)) refuse(what, path, "is no plain file");
  return real;
}

void push_path(lua_State* L, const fs::path& path) {
  const std::string text = path.string();
  lua_pushlstring(L, text.data(), text.size());
}

// io.open(path, mode); upvalue: Lua's own.
int io_open(Session& session, lua_State* L) {
  lua_settop(L, 2);
  const std::string path = text_at(L, 1, "io.open: path");
  const std::string mode = lua_isnil(L, 2) ? "r" : text_at(L, 2, "io.open: mode");
  const bool reads = mode == "r" || mode == "rb";
  const fs::path real = reads ? readable_file(session, "io.open", path) : writable(session, "io.open", path);
  lua_pushvalue(L, lua_upvalueindex(1));
  push_path(L, real);
  lua_pushlstring(L, mode.data(), mode.size());
  lua_call(L, 2, LUA_MULTRET);
  return lua_gettop(L) - 2;
}

// io.lines(path, …); upvalue: Lua's own.
int io_lines(Session& session, lua_State* L) {
  const fs::path real = readable_file(session, "io.lines", text_at(L, 1, "io.lines: path"));
  const int count = lua_gettop(L);
  push_path(L, real);
  lua_replace(L, 1);
  lua_pushvalue(L, lua_upvalueindex(1));
  lua_insert(L, 1);
  lua_call(L, count, LUA_MULTRET);
  return lua_gettop(L);
}

// How messages call a file beside the script: as the user would type it.
std::string shown_name(const Session& session, const std::string& relative) {
  return (fs::path(session.spec.file).parent_path() / relative).string();
}

// Leaves the compiled function on the stack.
void compile_file(Session& session, lua_State* L, const std::string& what, const std::string& path) {
  const fs::path real = readable_file(session, what, path);
  std::error_code error;
  if (!fs::exists(real, error)) refuse(what, path, "is not beside the script");
  std::string problem;
  const std::optional<std::string> text = read_script(real, problem);
  if (!text) refuse(what, path, problem);
  session.interpreter->compile(L, *text, shown_name(session, path));
}

int dofile(Session& session, lua_State* L) {
  lua_settop(L, 1);
  compile_file(session, L, "dofile", text_at(L, 1, "dofile: path"));
  lua_call(L, 0, LUA_MULTRET);
  return lua_gettop(L) - 1;
}

// require 'a.b' runs a/b.lua once and gives what it returns. A module that is being loaded is marked by
// false.
int require(Session& session, lua_State* L) {
  lua_settop(L, 1);
  const std::string name = text_at(L, 1, "require: name");
  luaL_getsubtable(L, LUA_REGISTRYINDEX, kModules);
  lua_pushvalue(L, 1);
  lua_rawget(L, 2);
  if (lua_isboolean(L, -1) && lua_toboolean(L, -1) == 0)
    throw Problem("require: '" + one_line(name) + "' requires itself");
  if (!lua_isnil(L, -1)) return 1;
  lua_pop(L, 1);
  std::string path = name;
  std::replace(path.begin(), path.end(), '.', '/');
  compile_file(session, L, "require", path + ".lua");
  lua_pushvalue(L, 1);
  lua_pushboolean(L, 0);
  lua_rawset(L, 2);
  lua_pushvalue(L, 1);
  lua_call(L, 1, 1);
  if (lua_isnil(L, -1) || (lua_isboolean(L, -1) && lua_toboolean(L, -1) == 0)) {
    lua_pop(L, 1);
    lua_pushboolean(L, 1);
  }
  lua_pushvalue(L, 1);
  lua_pushvalue(L, -2);
  lua_rawset(L, 2);
  return 1;
}

}  // namespace

fs::path readable_file(const Session& session, const std::string& what, const std::string& path) {
  if (session.options.unsafe) return session.folder / path;
  const fs::path output =
      session.options.output_folder.empty() ? fs::path() : resolved(session.options.output_folder);
  fs::path real = resolved(session.folder / path);
  std::error_code error;
  if (!fs::exists(real, error) && !output.empty() && fs::exists(resolved(output / path), error))
    real = resolved(output / path);
  const bool inside =
      !real.empty() && (is_within(real, session.folder) || (!output.empty() && is_within(real, output)));
  if (!inside) refuse(what, path, "is outside the script's folder and the output folder; --unsafe allows it");
  if (fs::exists(real, error) && !fs::is_regular_file(real, error)) refuse(what, path, "is no plain file");
  return real;
}

std::optional<std::string> read_script(const fs::path& path, std::string& problem) {
  std::error_code error;
  if (fs::is_directory(path, error)) {
    problem = "is a folder";
    return std::nullopt;
  }
  if (!fs::exists(path, error)) {
    problem = "does not exist";
    return std::nullopt;
  }
  std::ifstream file(path, std::ios::binary);
  if (!file) {
    problem = "cannot be read";
    return std::nullopt;
  }
  std::string text;
  char block[65536];
  while (file.read(block, sizeof block) || file.gcount() > 0) {
    text.append(block, static_cast<std::size_t>(file.gcount()));
    if (text.size() > kLargestScript) {
      problem = "is larger than 16 MiB";
      return std::nullopt;
    }
  }
  return text;
}

NamedText text_of_file(const Session& session, const std::string& what, const std::string& path) {
  const fs::path real = session.options.unsafe ? session.folder / path : readable_file(session, what, path);
  std::string problem;
  std::optional<std::string> text = read_script(real, problem);
  if (!text) refuse(what, path, problem);
  return {one_line(shown_name(session, path)), std::move(*text)};
}

void bind_files(lua_State* L) {
  lua_register(L, "dofile", guarded<dofile>);
  lua_register(L, "require", guarded<require>);
  luaL_requiref(L, LUA_IOLIBNAME, luaopen_io, 0);
  lua_newtable(L);
  lua_getfield(L, -2, "open");
  lua_pushcclosure(L, guarded<io_open>, 1);
  lua_setfield(L, -2, "open");
  lua_getfield(L, -2, "lines");
  lua_pushcclosure(L, guarded<io_lines>, 1);
  lua_setfield(L, -2, "lines");
  lua_getfield(L, -2, "type");
  lua_setfield(L, -2, "type");
  lua_setglobal(L, "io");
  lua_pop(L, 1);
}

}  // namespace smartsurf::script
