// One Lua state with limits: memory, instructions, and errors that come out as scene::InputError, one line
// each.
//
// Bound functions report a mistake by throwing Problem; guarded<> adds the script's file and line and raises
// it as a Lua error, so a script may catch it with pcall. Internal to the room.
#pragma once

#include <lua.hpp>

#include <cstddef>
#include <cstdint>
#include <exception>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "smartsurf/scene/SceneSpec.h"

namespace smartsurf::script {

struct Session;

// A clause without file and line: "sphere.radius = -1: must be greater than 0".
class Problem : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

class Interpreter {
 public:
  // `session` is what bound functions get. Throws std::bad_alloc when the limit does not hold an empty state.
  Interpreter(Session& session, std::size_t memory_limit);
  Interpreter(const Interpreter&) = delete;
  Interpreter& operator=(const Interpreter&) = delete;
  ~Interpreter();

  lua_State* lua() const { return lua_; }

  // Calls the function below its `arguments` on the stack with a fresh budget; throws InputError, or what
  // keep() was given. `fallback` is the place to name when the error happened outside any line of the script.
  // Everything that may run out of memory goes through here: Lua ends the process at an error that nobody
  // protects.
  void call(int arguments, int results, std::uint64_t budget, const std::string& fallback);

  // Inside a call: compiles source text (never bytecode) as `file` and leaves the function on the stack, or
  // raises the Lua error on `L`.
  void compile(lua_State* L, const std::string& text, const std::string& file);

  // Takes instructions off the budget of the running call; throws nothing, raises the Lua error on `L`.
  void charge(lua_State* L, std::uint64_t instructions);
  bool budget_exceeded() const { return budget_exceeded_; }
  // Keeps an exception that is no mistake of the script, to be thrown again by call().
  void keep(std::exception_ptr e) { kept_ = std::move(e); }

  // "FILE:LINE" of the innermost running line of the script, "" outside.
  std::string place(lua_State* L) const;

  static Session& session(lua_State* L);

 private:
  struct File {
    std::string name;        // as the user gave it
    std::string short_name;  // as Lua prints it in messages: cut to 60 characters
  };
  struct Located {
    std::string place, message;
  };

  static void* allocate(void* self, void* block, std::size_t old_size, std::size_t new_size);
  static void on_count(lua_State* L, lua_Debug*);
  static int on_error(lua_State* L);

  [[noreturn]] void fail(int status, const std::string& fallback);
  std::optional<Located> split_place(const std::string& message) const;
  [[noreturn]] void raise_budget(lua_State* L);

  lua_State* lua_ = nullptr;
  Session& session_;
  std::size_t memory_limit_, memory_used_ = 0;
  std::uint64_t budget_ = 0, spent_ = 0;
  bool budget_exceeded_ = false;
  std::vector<File> files_;
  std::string error_place_, memory_place_;
  std::exception_ptr kept_;
};

// A number as it stands in a message: short, "nan" without a sign.
std::string show(double value);
// Control characters out, so that a message stays one line; cut when very long.
std::string one_line(std::string_view text);

using Binding = int (*)(Session&, lua_State*);

// Leaves the Lua error value for `e` on the stack.
void report(Session&, lua_State* L, const std::exception& e);

// Binding → lua_CFunction: exceptions become Lua errors with the script's place.
template <Binding binding>
int guarded(lua_State* L) {
  Session& session = Interpreter::session(L);
  try {
    return binding(session, L);
  } catch (const std::exception& e) {
    // Lua's own errors are no std::exception and pass by.
    report(session, L, e);
  }
  return lua_error(L);
}

}  // namespace smartsurf::script
