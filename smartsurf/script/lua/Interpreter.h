// A Lua state with limits on memory and instructions, whose errors become scene::InputError, one line each.
//
// Bound functions report a mistake by throwing Problem; guarded<> adds the script's file and line and raises
// it as a Lua error, which a script may catch with pcall. Internal to this module.
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

struct ScriptContext;

// A clause without file and line: "sphere.radius = -1: must be greater than 0".
class ScriptError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

class Interpreter {
 public:
  // `session` is what bound functions get. Throws std::bad_alloc when the limit does not hold an empty state.
  Interpreter(ScriptContext& context, std::size_t memory_limit);
  Interpreter(const Interpreter&) = delete;
  Interpreter& operator=(const Interpreter&) = delete;
  ~Interpreter();

  lua_State* lua() const { return lua_; }

  // Calls the function below its `arguments` on the stack with a fresh budget; throws InputError, or what
  // keep() was given. `fallback` is the place to name when the error happened outside any line of the script.
  // Everything that may run out of memory goes through here: Lua ends the process at an error that nobody
  // protects.
  void call(int arguments, int results, std::uint64_t budget, const std::string& fallback_location);

  // Inside a call: compiles source text (never bytecode) as `file` and leaves the function on the stack, or
  // raises the Lua error on `L`.
  void compile(lua_State* L, const std::string& text, const std::string& file);

  // Takes instructions off the budget of the running call; throws nothing, raises the Lua error on `L`.
  void charge(lua_State* L, std::uint64_t instructions);
  bool budget_exceeded() const { return budget_exceeded_; }
  // Keeps an exception that is no mistake of the script, to be thrown again by call().
  void defer_exception(std::exception_ptr e) { deferred_exception_ = std::move(e); }

  // "FILE:LINE" of the innermost running line of the script, "" outside.
  std::string current_location(lua_State* L) const;

  static ScriptContext& context_of(lua_State* L);

 private:
  struct Chunk {
    std::string name;        // as the user gave it
    std::string short_name;  // as Lua prints it in messages: cut to 60 characters
  };
  struct LocatedMessage {
    std::string location, message;
  };

  static void* allocate(void* self, void* block, std::size_t old_size, std::size_t new_size);
  static void on_instruction_count(lua_State* L, lua_Debug*);
  static int on_error(lua_State* L);

  [[noreturn]] void throw_input_error(int status, const std::string& fallback_location);
  std::optional<LocatedMessage> split_location(const std::string& message) const;
  [[noreturn]] void raise_budget_error(lua_State* L);

  lua_State* lua_ = nullptr;
  ScriptContext& context_;
  std::size_t memory_limit_, memory_used_ = 0;
  std::uint64_t instruction_budget_ = 0, instructions_used_ = 0;
  bool budget_exceeded_ = false;
  std::vector<Chunk> chunks_;
  std::string error_location_, memory_error_location_;
  std::exception_ptr deferred_exception_;
};

// A number as it stands in a message: short, "nan" without a sign.
std::string format_value(double value);
// Control characters out, so that a message stays one line; cut when very long.
std::string to_single_line(std::string_view text);

using BoundFunction = int (*)(ScriptContext&, lua_State*);

// Leaves the Lua error value for `e` on the stack.
void push_error(ScriptContext&, lua_State* L, const std::exception& e);

// Binding → lua_CFunction: exceptions become Lua errors with the script's place.
template <BoundFunction binding>
int guarded(lua_State* L) {
  ScriptContext& context = Interpreter::context_of(L);
  try {
    return binding(context, L);
  } catch (const std::exception& e) {
    // Lua's own errors are no std::exception and pass by.
    push_error(context, L, e);
  }
  return lua_error(L);
}

}  // namespace smartsurf::script
