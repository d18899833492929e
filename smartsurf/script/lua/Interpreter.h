// A Lua state with memory and instruction limits, whose errors become one-line scene::InputErrors.
//
// Bound functions report errors by throwing ScriptError. guarded<> adds the script's file and line and raises
// a Lua error, which a script may catch with pcall. Internal to this module.
#pragma once

#include <lua.hpp>

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <exception>
#include <filesystem>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "smartsurf/scene/SceneSpec.h"
#include "smartsurf/script/LoadOptions.h"
#include "smartsurf/script/lua/OperationWatch.h"

namespace smartsurf::script {

struct Sandbox;

// A clause without file and line: "sphere.radius = -1: must be greater than 0".
class ScriptError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

// A limit of the sandbox, beyond which the run ends, whether or not the script catches the error.
class LimitError : public ScriptError {
 public:
  using ScriptError::ScriptError;
};

// Throws ScriptError, `prefix` and the clause, unless the clause of a validate() is empty.
inline void throw_if_invalid(const std::string& clause, const std::string& prefix = "") {
  if (!clause.empty()) throw ScriptError(prefix + clause);
}

// The limits of one call.
struct Budget {
  std::uint64_t instructions = 0;
  double seconds = 0.0;  // of this thread's processor time
};

// Bytes that a library function copies or compares in the time of one instruction.
constexpr std::uint64_t kBytesPerInstruction = 64;
// Operators on strings take time in proportion to the length, and only whole instructions are counted.
constexpr std::size_t kMaxStringBytes = std::size_t{16} << 20;
constexpr const char* kLongString = "a string is longer than 16 MiB";

class Interpreter {
 public:
  // `sandbox` is passed to bound functions and must outlive the interpreter. memory_limit is in bytes. Throws
  // std::bad_alloc if it is too small for an empty state.
  Interpreter(Sandbox& sandbox, std::size_t memory_limit);
  Interpreter(const Interpreter&) = delete;
  Interpreter& operator=(const Interpreter&) = delete;
  ~Interpreter();

  lua_State* lua() const { return lua_; }

  // Calls the function below its `arguments` on the stack with a budget. Throws InputError, Interrupted, or
  // the exception passed to defer_exception. `fallback_location` is reported for an error outside any line of
  // the script. All code that can raise a Lua error, including out of memory, must run inside call(): Lua
  // aborts the process on an unprotected error.
  void call(int arguments, int results, const Budget& budget, const std::string& fallback_location);

  // Compiles source text (not bytecode) with the chunk name `file` and pushes the function, or raises a Lua
  // error on `L`. Call only inside call().
  void compile(lua_State* L, const std::string& text, const std::string& file);
  // Does what lua_load() does with mode "t", and charges an instruction for each byte that the compiler
  // takes.
  int compile_metered(lua_State* L, std::string_view text, const char* chunk);

  // Charges instructions to the budget of the running call. Raises a Lua error on `L` when it is exceeded. A
  // library function that takes long calls it before or while it works.
  void charge(lua_State* L, std::uint64_t instructions);
  // The coroutine that runs from here to the end of the scope.
  class RunningCoroutine {
   public:
    RunningCoroutine(Interpreter& interpreter, lua_State* caller, lua_State* coroutine);
    ~RunningCoroutine();
    RunningCoroutine(const RunningCoroutine&) = delete;
    RunningCoroutine& operator=(const RunningCoroutine&) = delete;

   private:
    Interpreter& interpreter_;
    lua_State* caller_;
  };
  // A scope within which a call that takes too long fails with the message `overrun`, with file and line.
  class NamedOperation {
   public:
    NamedOperation(Interpreter& interpreter, std::string overrun);
    ~NamedOperation();
    NamedOperation(const NamedOperation&) = delete;
    NamedOperation& operator=(const NamedOperation&) = delete;

   private:
    Interpreter& interpreter_;
  };
  // Ends the running call with the message, whatever becomes of the Lua error that the caller raises on `L`.
  void end_call(lua_State* L, const std::string& why);
  bool budget_exceeded() const { return budget_exceeded_; }
  std::size_t memory_used() const { return memory_used_; }  // of the Lua heap, in bytes
  // Stores an exception that is not the script's error; call() rethrows it.
  void defer_exception(std::exception_ptr e) { deferred_exception_ = std::move(e); }

  // "FILE:LINE" of the innermost running line of the script; "" if none is running.
  std::string current_location(lua_State* L) const;

  static Sandbox& sandbox_of(lua_State* L);

 private:
  struct Chunk {
    std::string name;        // as given by the user
    std::string short_name;  // as in Lua's messages, abbreviated to 60 characters
  };
  struct LocatedMessage {
    std::string location, message;
  };
  // Arguments of the allocator.
  struct Request {
    const void* block;
    std::size_t old_size, new_size;
    bool operator==(const Request&) const = default;
  };

  static void* allocate(void* self, void* block, std::size_t old_size, std::size_t new_size);
  static void on_instruction_count(lua_State* L, lua_Debug*);
  static int on_error(lua_State* L);

  void set_hook(lua_State* L, int interval);
  void shorten_interval(std::size_t string_bytes);
  void refuse_memory(const Request&, const std::string& why);
  void check_time(lua_State* L);
  // location: where the message names none.
  [[noreturn]] void throw_input_error(std::string message, std::string location) const;
  std::optional<LocatedMessage> split_location(const std::string& message) const;
  // Raises the error of end_call(), and so does every further instruction.
  [[noreturn]] void raise_end(lua_State* L, const std::string& why);

  lua_State* lua_ = nullptr;
  Sandbox& sandbox_;
  std::size_t memory_limit_, memory_used_ = 0;
  std::uint64_t instruction_budget_ = 0, instructions_used_ = 0;
  bool budget_exceeded_ = false;
  std::string budget_message_;  // of the first error
  // The processor time that the running call may take, and that at its first check, −1 before.
  double time_limit_s_ = 0.0, started_s_ = -1.0, children_before_s_ = 0.0;
  std::int64_t last_time_check_ns_ = 0;
  bool stopped_ = false;                      // it ends because of LoadOptions::stop
  static constexpr int kHookInterval = 1000;  // with short strings and an ample budget
  int interval_ = kHookInterval;              // instructions between two calls of the hook
  int string_interval_ = kHookInterval;       // its upper bound, for the longest string
  lua_State* running_ = nullptr;              // the coroutine that runs; null outside of call()
  std::optional<Request> refused_;            // by the allocator since the last instruction
  std::string refusal_;                       // why, with the location if there is one
  std::vector<Chunk> chunks_;
  std::string error_location_;
  std::exception_ptr deferred_exception_;
  std::atomic<std::shared_ptr<const std::string>> overrun_message_;  // of a NamedOperation; read by the watch
  std::unique_ptr<OperationWatch> watch_;                            // null without LoadOptions::end_process
};

// A registered callback of the script.
struct Callback {
  int reference = LUA_NOREF;  // in the Lua registry
  std::string location;       // "FILE:LINE" of the registration
};

// The state of a script that the interpreter and the library share.
struct Sandbox {
  LoadOptions options;
  std::string file;                     // path as given by the user
  std::filesystem::path script_folder;  // canonical
  Interpreter* interpreter = nullptr;
  std::deque<Callback> callbacks;   // a call may add to them: references stay valid
  std::vector<int> free_callbacks;  // unused slots of `callbacks`
  // While a script loads whose state may be saved: of the files that it has read, and of the names that it
  // gives them. Meshes are not among them.
  std::optional<std::uint64_t> files_hash;
};

// A number as shown in messages; "nan" has no sign.
std::string format_value(double value);
// Replaces control characters by spaces and truncates long text, so that a message fits one line.
std::string to_single_line(std::string_view text);

// Leaves the Lua error value for `e` on the stack.
void push_error(Sandbox&, lua_State* L, const std::exception& e);

// Wraps a binding, int(Sandbox&, lua_State*) or with a struct derived from Sandbox, as a lua_CFunction that
// converts exceptions to Lua errors with the script's location.
template <auto binding>
int guarded(lua_State* L) {
  Sandbox& sandbox = Interpreter::sandbox_of(L);
  const auto call = [&]<class Context>(int (*function)(Context&, lua_State*)) {
    return function(static_cast<Context&>(sandbox), L);
  };
  try {
    return call(binding);
  } catch (const std::exception& e) {
    // Lua's own errors are not derived from std::exception and propagate.
    push_error(sandbox, L, e);
  }
  return lua_error(L);
}

}  // namespace smartsurf::script
