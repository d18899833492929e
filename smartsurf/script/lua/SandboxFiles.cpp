// require, dofile and io of a sandboxed script. It can read in its own folder and in the output folder, and
// write in the output folder only. Symbolic links are resolved before the check.
#include <algorithm>
#include <filesystem>
#include <iterator>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>

#include "common/files/Inputs.h"
#include "common/files/ReadFile.h"
#include "common/files/RealPath.h"
#include "common/hash/Fnv.h"
#include "smartsurf/script/lua/SandboxFiles.h"
#include "smartsurf/script/lua/TableReader.h"

namespace smartsurf::script {
namespace fs = std::filesystem;
namespace {

constexpr const char* kModuleTable = "smartsurf.modules";

bool is_within(const fs::path& path, const fs::path& folder) {
  const auto [f, p] = std::mismatch(folder.begin(), folder.end(), path.begin(), path.end());
  return f == folder.end() || (std::next(f) == folder.end() && f->empty());
}

[[noreturn]] void throw_path_error(const std::string& subject, const std::string& path,
                                   const std::string& requirement) {
  throw ScriptError(subject + ": '" + to_single_line(path) + "' " + requirement);
}

// A link would lead the script's files elsewhere.
void create_output_folder(const fs::path& folder) {
  std::error_code error;
  fs::create_directory(folder, error);
  if (!fs::is_directory(fs::symlink_status(folder, error)))
    throw ScriptError(
        "the folder of the script's files, '" + to_single_line(folder.string()) +
        "', cannot be created: " + (error ? error.message() : "there is another file of this name"));
}

fs::path resolve_writable_path(const Sandbox& sandbox, const std::string& subject, const std::string& path) {
  if (sandbox.options.output_folder.empty())
    throw_path_error(subject, path, "cannot be written: this run has no output folder");
  create_output_folder(sandbox.options.output_folder);
  std::error_code unreachable;
  const fs::path output = common::real_path(sandbox.options.output_folder),
                 real = common::real_path(output / path, unreachable);
  if (common::leads_nowhere(unreachable))
    throw_path_error(subject, path, "cannot be found: " + unreachable.message());
  if (real.empty() || output.empty() || !is_within(real, output))
    throw_path_error(subject, path, "is outside the output folder; --unsafe allows it");
  std::error_code error;
  if (fs::exists(real, error) && !fs::is_regular_file(real, error))
    throw_path_error(subject, path, "is not a regular file");
  if (common::is_input(real)) throw_path_error(subject, path, "is an input of this run");
  if (common::withhold_output(real)) throw_path_error(subject, path, "is an output of this run");
  if (const std::uintmax_t links = fs::hard_link_count(real, error); !error && links > 1)
    throw_path_error(subject, path, "has other names, which are not the script's to write: delete this one");
  return real;
}

// `content`: null if the file cannot be read.
void note_content(Sandbox& sandbox, const std::string& path, const std::string* content) {
  if (!sandbox.files_hash) return;
  for (const std::uint64_t hash : {common::fnv1a(path), content != nullptr ? common::fnv1a(*content) : 0})
    sandbox.files_hash = common::fnv_mix(*sandbox.files_hash, hash);
}

// Lua will read the file, if it is there.
void note_file(Sandbox& sandbox, const std::string& path, const fs::path& real) {
  constexpr std::size_t kMaxBytes = std::size_t{1} << 30;
  if (!sandbox.files_hash) return;
  std::string content;
  const std::error_code error = common::read_file(real, kMaxBytes, content);
  note_content(sandbox, path, error ? nullptr : &content);
}

// The content of a file beside the script.
std::string read_noted(Sandbox& sandbox, const std::string& subject, const std::string& path,
                       const fs::path& real) {
  std::string reason;
  std::optional<std::string> text = read_text_file(real, reason);
  note_content(sandbox, path, text ? &*text : nullptr);
  if (!text) throw_path_error(subject, path, reason);
  return std::move(*text);
}

void push_path(lua_State* L, const fs::path& path) {
  const std::string text = path.string();
  lua_pushlstring(L, text.data(), text.size());
}

// Where the path cannot be followed: as Lua's io.open, which returns nil, a message and the system's number.
int push_failure(lua_State* L, const std::string& path, const std::error_code& error) {
  lua_pushnil(L);
  const std::string text = to_single_line(path) + ": " + error.message();
  lua_pushlstring(L, text.data(), text.size());
  lua_pushinteger(L, error.value());
  return 3;
}

// io.open(path, mode). Upvalue: Lua's io.open. Throws what the sandbox refuses: a script that goes on without
// looking at the result would not do what it says.
int io_open(Sandbox& sandbox, lua_State* L) {
  lua_settop(L, 2);
  const std::string path = check_string(L, 1, "io.open: path");
  const std::string mode = lua_isnil(L, 2) ? "r" : check_string(L, 2, "io.open: mode");
  const bool reads = mode == "r" || mode == "rb";
  if (std::error_code error; !sandbox.options.unsafe) {
    const fs::path& base = reads ? sandbox.script_folder : sandbox.options.output_folder;
    if (reads || !base.empty()) (void)common::real_path(base / path, error);
    if (common::leads_nowhere(error)) return push_failure(L, path, error);
  }
  const fs::path real = reads ? resolve_readable_path(sandbox, "io.open", path)
                              : resolve_writable_path(sandbox, "io.open", path);
  if (reads) note_file(sandbox, path, real);
  lua_pushvalue(L, lua_upvalueindex(1));
  push_path(L, real);
  lua_pushlstring(L, mode.data(), mode.size());
  lua_call(L, 2, LUA_MULTRET);
  if (std::error_code error; !reads && lua_isnil(L, 3) && !fs::is_directory(real.parent_path(), error)) {
    const std::string text = to_single_line(path) + ": there is no such folder in " +
                             to_single_line(sandbox.options.output_folder.string()) +
                             "/, where a script's files go";
    lua_pushlstring(L, text.data(), text.size());
    lua_replace(L, 4);
  }
  return lua_gettop(L) - 2;
}

// io.lines(path, …). Upvalue: Lua's io.lines.
int io_lines(Sandbox& sandbox, lua_State* L) {
  const std::string path = check_string(L, 1, "io.lines: path");
  const fs::path real = resolve_readable_path(sandbox, "io.lines", path);
  note_file(sandbox, path, real);
  const int count = lua_gettop(L);
  push_path(L, real);
  lua_replace(L, 1);
  lua_pushvalue(L, lua_upvalueindex(1));
  lua_insert(L, 1);
  lua_call(L, count, LUA_MULTRET);
  return lua_gettop(L);
}

// The name of a file beside the script in messages: its path as the user would type it.
std::string display_path(const Sandbox& sandbox, const std::string& relative) {
  return (fs::path(sandbox.file).parent_path() / relative).string();
}

// Compiles a file beside the script and pushes the function.
void load_file(Sandbox& sandbox, lua_State* L, const std::string& subject, const std::string& path) {
  const fs::path real = resolve_readable_path(sandbox, subject, path);
  std::error_code error;
  if (!fs::exists(real, error)) {
    note_content(sandbox, path, nullptr);
    throw_path_error(subject, path, "is not beside the script");
  }
  sandbox.interpreter->compile(L, read_noted(sandbox, subject, path, real), display_path(sandbox, path));
}

int dofile(Sandbox& sandbox, lua_State* L) {
  lua_settop(L, 1);
  load_file(sandbox, L, "dofile", check_string(L, 1, "dofile: path"));
  lua_call(L, 0, LUA_MULTRET);
  return lua_gettop(L) - 1;
}

// require 'a.b' runs a/b.lua once and returns its result. The module table holds false while a module loads.
int require(Sandbox& sandbox, lua_State* L) {
  lua_settop(L, 1);
  const std::string name = check_string(L, 1, "require: name");
  luaL_getsubtable(L, LUA_REGISTRYINDEX, kModuleTable);
  lua_pushvalue(L, 1);
  lua_rawget(L, 2);
  if (lua_isboolean(L, -1) && lua_toboolean(L, -1) == 0)
    throw ScriptError("require: '" + to_single_line(name) + "' requires itself");
  if (!lua_isnil(L, -1)) return 1;
  lua_pop(L, 1);
  std::string path = name;
  std::replace(path.begin(), path.end(), '.', '/');
  load_file(sandbox, L, "require", path + ".lua");
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

fs::path resolve_readable_path(const Sandbox& sandbox, const std::string& subject, const std::string& path) {
  if (sandbox.options.unsafe) return sandbox.script_folder / path;
  const fs::path output =
      sandbox.options.output_folder.empty() ? fs::path() : common::real_path(sandbox.options.output_folder);
  std::error_code error;
  fs::path real = common::real_path(sandbox.script_folder / path, error);
  if (common::leads_nowhere(error)) throw_path_error(subject, path, "cannot be found: " + error.message());
  if (!fs::exists(real, error) && !output.empty() && fs::exists(common::real_path(output / path), error))
    real = common::real_path(output / path);
  const bool inside = !real.empty() && (is_within(real, sandbox.script_folder) ||
                                        (!output.empty() && is_within(real, output)));
  if (!inside)
    throw_path_error(subject, path,
                     "is outside the script's folder and the output folder; --unsafe allows it");
  if (fs::exists(real, error) && !fs::is_regular_file(real, error))
    throw_path_error(subject, path, "is not a regular file");
  if (common::withhold_output(real)) throw_path_error(subject, path, "is an output of this run");
  // The script may overwrite what it has written itself.
  if (output.empty() || !is_within(real, output)) common::note_input(real);
  return real;
}

std::optional<std::string> read_text_file(const fs::path& path, std::string& reason) {
  std::error_code error;
  if (fs::is_directory(path, error)) {
    reason = "is a folder";
    return std::nullopt;
  }
  if (!fs::exists(path, error)) {
    reason = "does not exist";
    return std::nullopt;
  }
  std::string text;
  const std::error_code failure = common::read_file(path, common::kMaxTextBytes, text);
  if (!failure) return text;
  reason =
      failure == std::errc::file_too_large ? "is larger than 16 MiB" : "cannot be read: " + failure.message();
  return std::nullopt;
}

NamedFile read_sandboxed_file(Sandbox& sandbox, const std::string& subject, const std::string& path) {
  return {to_single_line(display_path(sandbox, path)),
          read_noted(sandbox, subject, path, resolve_readable_path(sandbox, subject, path))};
}

void bind_file_access(lua_State* L) {
  lua_register(L, "dofile", guarded<dofile>);
  lua_register(L, "require", guarded<require>);
  luaL_requiref(L, LUA_IOLIBNAME, luaopen_io, 0);
  // Out of the script's reach: Lua would run a finalizer that it puts there with the count hook disabled.
  luaL_getmetatable(L, LUA_FILEHANDLE);
  lua_pushliteral(L, "locked");
  lua_setfield(L, -2, "__metatable");
  lua_pop(L, 1);
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
