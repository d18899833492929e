#include "smartsurf/script/lua/Interpreter.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <limits>
#include <new>
#include <utility>

#include "common/arithmetic/StandardArithmetic.h"
#include "common/process/ChildWork.h"
#include "common/text/ClassicLocale.h"
#include "common/text/Utf8.h"

namespace smartsurf::script {
namespace {

constexpr std::size_t kShortStringBytes = 64 << 10;
constexpr std::size_t kStringHeaderBytes = 64;  // upper bound
constexpr std::int64_t kTimeCheckInterval_ns = 5'000'000;
constexpr std::size_t kMaxMessageLength = 500;
constexpr std::size_t kSourcePieceBytes = 4096;
constexpr const char* kOverrun =
    ": one operation of the script took too long and cannot be interrupted: a table or a string that is too "
    "large?";

// Finds the innermost Lua function of the script on the call stack. C functions have no line.
bool find_innermost_line(lua_State* L, lua_Debug& ar) {
  for (int level = 0; lua_getstack(L, level, &ar); ++level)
    if (lua_getinfo(L, "Sl", &ar) && ar.currentline > 0 && ar.source[0] == '@') return true;
  return false;
}

std::int64_t coarse_time_ns() {
  struct timespec now {};
  ::clock_gettime(CLOCK_MONOTONIC_COARSE, &now);
  return std::int64_t{now.tv_sec} * 1'000'000'000 + now.tv_nsec;
}

// The chunk's name as Lua abbreviates it in messages.
std::string chunk_short_name(lua_State* L, const std::string& chunk) {
  if (luaL_loadbufferx(L, "", 0, chunk.c_str(), "t") != LUA_OK) lua_error(L);
  lua_Debug ar;
  lua_getinfo(L, ">S", &ar);
  return ar.short_src;
}

}  // namespace

std::string format_value(double value) {
  if (std::isnan(value)) return "nan";
  char text[32];
  std::snprintf(text, sizeof text, "%.14g", value);
  return text;
}

std::string to_single_line(std::string_view text) {
  std::string line;
  for (const char c : text.substr(0, kMaxMessageLength))
    line += static_cast<unsigned char>(c) < 0x20 || c == 0x7f ? ' ' : c;
  if (text.size() > kMaxMessageLength) line += "...";
  return line;
}

Interpreter::Interpreter(Sandbox& sandbox, std::size_t memory_limit)
    : sandbox_(sandbox), memory_limit_(memory_limit) {
  lua_State* const L = lua_newstate(&Interpreter::allocate, this);
  if (L == nullptr) throw std::bad_alloc();
  lua_ = L;
  Sandbox* const pointer = &sandbox_;
  std::memcpy(lua_getextraspace(L), &pointer, sizeof pointer);
  const LoadOptions& options = sandbox.options;
  if (options.end_process == nullptr || options.unsafe) return;
  watch_ = std::make_unique<OperationWatch>(options.stop, [this](bool stopped) {
    const std::shared_ptr<const std::string> message = overrun_message_.load();
    sandbox_.options.end_process(stopped ? std::string() : message ? *message : sandbox_.file + kOverrun);
  });
}

Interpreter::NamedOperation::NamedOperation(Interpreter& interpreter, std::string overrun)
    : interpreter_(interpreter) {
  interpreter_.overrun_message_.store(std::make_shared<const std::string>(std::move(overrun)));
}

Interpreter::NamedOperation::~NamedOperation() { interpreter_.overrun_message_.store(nullptr); }

Interpreter::~Interpreter() {
  lua_sethook(lua_, nullptr, 0, 0);
  lua_close(lua_);
}

Sandbox& Interpreter::sandbox_of(lua_State* L) {
  Sandbox* pointer = nullptr;
  std::memcpy(&pointer, lua_getextraspace(L), sizeof pointer);
  return *pointer;
}

void* Interpreter::allocate(void* self, void* block, std::size_t old_size, std::size_t new_size) {
  auto& interpreter = *static_cast<Interpreter*>(self);
  const bool is_string = block == nullptr && old_size == LUA_TSTRING;
  const Request request{block, old_size, new_size};
  if (block == nullptr) old_size = 0;  // Lua passes the type of the new object instead
  if (new_size == 0) {
    std::free(block);
    interpreter.memory_used_ -= old_size;
    return nullptr;
  }
  const bool grows = new_size > old_size;
  if (grows && new_size - old_size > interpreter.memory_limit_ -
                                         std::min(interpreter.memory_limit_, interpreter.memory_used_)) {
    interpreter.refuse_memory(request,
                              "the script needs more than " +
                                  format_value(static_cast<double>(interpreter.memory_limit_) / 1048576.0) +
                                  " MiB of memory");
    return nullptr;
  }
  if (is_string && new_size > kMaxStringBytes + kStringHeaderBytes) {
    interpreter.refuse_memory(request, kLongString);
    return nullptr;
  }
  if (is_string && new_size > kShortStringBytes) interpreter.shorten_interval(new_size);
  void* const moved = std::realloc(block, new_size);
  if (moved == nullptr) return nullptr;
  interpreter.memory_used_ = interpreter.memory_used_ - old_size + new_size;
  if (grows && interpreter.refused_ && *interpreter.refused_ == request) interpreter.refused_.reset();
  return moved;
}

// Lua asks once more after a collection. Otherwise the next instruction ends the run, whether or not the
// script has caught the error.
void Interpreter::refuse_memory(const Request& request, const std::string& why) {
  refused_ = request;
  refusal_ = why;
  if (running_ == nullptr) return;
  // Memory errors carry no location.
  if (const std::string location = current_location(running_); !location.empty())
    refusal_ = location + ": " + why;
  set_hook(running_, 1);
}

void Interpreter::set_hook(lua_State* L, int interval) {
  lua_sethook(L, &Interpreter::on_instruction_count, LUA_MASKCOUNT, interval);
}

// Bounds the time between two calls of the hook: an instruction takes time in proportion to the longest
// string.
void Interpreter::shorten_interval(std::size_t string_bytes) {
  const auto interval = std::max(static_cast<int>(kHookInterval * kShortStringBytes / string_bytes), 1);
  if (interval >= string_interval_) return;
  string_interval_ = interval;
  interval_ = std::min(interval_, interval);
  if (running_ != nullptr && !budget_exceeded_) set_hook(running_, interval_);
}

void Interpreter::on_instruction_count(lua_State* L, lua_Debug*) {
  Interpreter& interpreter = *sandbox_of(L).interpreter;
  interpreter.running_ = L;
  const int interval = lua_gethookcount(L);
  if (!interpreter.budget_exceeded_ && interval != interpreter.interval_)
    interpreter.set_hook(L, interpreter.interval_);
  if (interpreter.refused_) interpreter.raise_end(L, interpreter.refusal_);
  interpreter.charge(L, static_cast<std::uint64_t>(interval));
}

void Interpreter::charge(lua_State* L, std::uint64_t instructions) {
  instructions_used_ =
      std::min(instructions_used_, std::numeric_limits<std::uint64_t>::max() - instructions) + instructions;
  if (instructions_used_ > instruction_budget_ || budget_exceeded_)
    raise_end(L, current_location(L) + ": the script ran for more than " +
                     std::to_string(instruction_budget_) + " instructions: an endless loop?");
  check_time(L);
}

void Interpreter::check_time(lua_State* L) {
  const std::int64_t now_ns = coarse_time_ns();
  if (now_ns - last_time_check_ns_ < kTimeCheckInterval_ns) return;
  last_time_check_ns_ = now_ns;
  if (watch_) watch_->next();
  // The clock of the thread is a system call, which short calls do without.
  if (started_s_ < 0.0) started_s_ = thread_time_s(CLOCK_THREAD_CPUTIME_ID);
  const double used_s =
      thread_time_s(CLOCK_THREAD_CPUTIME_ID) - started_s_ + common::child_time_s() - children_before_s_;
  const std::atomic<bool>* const stop = sandbox_.options.stop;
  const bool stopped = stop != nullptr && stop->load(std::memory_order_relaxed);
  if (used_s <= (stopped ? std::min(kTimeAfterStop_s, time_limit_s_) : time_limit_s_)) return;
  stopped_ = stopped;
  raise_end(L, stopped ? "interrupted"
                       : current_location(L) + ": the script ran for more than " +
                             format_value(time_limit_s_) + " s: an endless loop?");
}

void Interpreter::end_call(lua_State* L, const std::string& why) {
  if (!budget_exceeded_) budget_message_ = why;
  budget_exceeded_ = true;
  set_hook(L, 1);
}

void Interpreter::raise_end(lua_State* L, const std::string& why) {
  end_call(L, why);
  lua_pushlstring(L, budget_message_.data(), budget_message_.size());
  lua_error(L);
  std::abort();  // lua_error does not return
}

// A new coroutine inherits the hook of its creator, whose interval may have been longer.
Interpreter::RunningCoroutine::RunningCoroutine(Interpreter& interpreter, lua_State* caller,
                                                lua_State* coroutine)
    : interpreter_(interpreter), caller_(caller) {
  interpreter_.running_ = coroutine;
  if (lua_gethookcount(coroutine) > interpreter_.interval_)
    interpreter_.set_hook(coroutine, interpreter_.interval_);
}

Interpreter::RunningCoroutine::~RunningCoroutine() {
  interpreter_.running_ = caller_;
  const int interval = interpreter_.budget_exceeded_ || interpreter_.refused_ ? 1 : interpreter_.interval_;
  if (lua_gethookcount(caller_) > interval) interpreter_.set_hook(caller_, interval);
}

int Interpreter::on_error(lua_State* L) {
  Interpreter& interpreter = *sandbox_of(L).interpreter;
  interpreter.error_location_ = interpreter.current_location(L);
  return 1;
}

std::string Interpreter::current_location(lua_State* L) const {
  lua_Debug ar;
  if (!find_innermost_line(L, ar)) return "";
  return std::string(ar.source + 1) + ":" + std::to_string(ar.currentline);
}

void Interpreter::compile(lua_State* L, const std::string& text, const std::string& file) {
  const std::string chunk = "@" + file;
  if (std::none_of(chunks_.begin(), chunks_.end(), [&](const Chunk& f) { return f.name == file; }))
    chunks_.push_back({file, chunk_short_name(L, chunk)});
  std::string_view source = common::without_byte_order_mark(text);
  // Skip a "#!" line, as Lua does for files, but keep its newline for the line count.
  if (source.starts_with("#")) source.remove_prefix(std::min(source.find('\n'), source.size()));
  if (source.starts_with(LUA_SIGNATURE[0])) {
    lua_pushfstring(L, "%s:1: this is compiled Lua; give the source text", file.c_str());
    lua_error(L);
  }
  if (compile_metered(L, source, chunk.c_str()) != LUA_OK) lua_error(L);
}

int Interpreter::compile_metered(lua_State* L, std::string_view text, const char* chunk) {
  struct Source {
    Interpreter& interpreter;
    std::string_view rest;
  } source{*this, text};
  const lua_Reader read = [](lua_State* state, void* data, std::size_t* size) {
    auto& from = *static_cast<Source*>(data);
    const std::string_view piece = from.rest.substr(0, kSourcePieceBytes);
    from.rest.remove_prefix(piece.size());
    from.interpreter.charge(state, piece.size());
    *size = piece.size();
    return piece.data();
  };
  return lua_load(L, read, &source, chunk, "t");
}

void Interpreter::call(int arguments, int results, const Budget& budget,
                       const std::string& fallback_location) {
  const common::ClassicLocale locale;
  const common::StandardArithmetic arithmetic;
  instruction_budget_ = budget.instructions;
  instructions_used_ = 0;
  budget_exceeded_ = false;
  budget_message_.clear();
  refused_.reset();
  stopped_ = false;
  time_limit_s_ = budget.seconds;
  started_s_ = -1.0;
  children_before_s_ = common::child_time_s();
  last_time_check_ns_ = coarse_time_ns();
  error_location_.clear();
  interval_ = std::min(string_interval_,
                       static_cast<int>(std::clamp<std::uint64_t>(budget.instructions, 1, kHookInterval)));
  running_ = lua_;
  set_hook(lua_, interval_);
  if (watch_) watch_->begin(time_limit_s_);
  const int base = lua_gettop(lua_) - arguments;
  lua_pushcfunction(lua_, &Interpreter::on_error);
  lua_insert(lua_, base);
  const int status = lua_pcall(lua_, arguments, results, base);
  running_ = nullptr;
  if (watch_) watch_->end();
  lua_sethook(lua_, nullptr, 0, 0);
  lua_remove(lua_, base);
  if (budget_exceeded_ && stopped_) {
    lua_settop(lua_, base - 1);
    deferred_exception_ = nullptr;
    throw Interrupted();
  }
  if (deferred_exception_) {
    lua_settop(lua_, base - 1);
    std::rethrow_exception(std::exchange(deferred_exception_, nullptr));
  }
  const std::string& location = error_location_.empty() ? fallback_location : error_location_;
  if (budget_exceeded_ || refused_) {
    // The end of the call, whatever became of the error: Lua returns it as a value where a coroutine is
    // closed.
    lua_settop(lua_, base - 1);
    throw_input_error(budget_exceeded_ ? budget_message_ : refusal_, location);
  }
  if (status == LUA_OK) return;
  if (sandbox_.options.stop != nullptr && sandbox_.options.stop->load(std::memory_order_relaxed)) {
    lua_settop(lua_, base - 1);
    throw Interrupted();  // whatever the stop has made fail
  }
  std::size_t length = 0;
  const char* const text = lua_type(lua_, -1) == LUA_TSTRING ? lua_tolstring(lua_, -1, &length) : nullptr;
  const std::string message =
      text != nullptr ? std::string(text, length)
                      : std::string("the script raised an error value of type ") + luaL_typename(lua_, -1);
  lua_pop(lua_, 1);
  throw_input_error(message, location);
}

std::optional<Interpreter::LocatedMessage> Interpreter::split_location(const std::string& message) const {
  for (const Chunk& file : chunks_) {
    for (const std::string& name : {file.name, file.short_name}) {
      if (!message.starts_with(name + ":")) continue;
      std::size_t end = name.size() + 1;
      while (end < message.size() && std::isdigit(static_cast<unsigned char>(message[end]))) ++end;
      if (end == name.size() + 1 || message.compare(end, 2, ": ") != 0) continue;
      return LocatedMessage{file.name + message.substr(name.size(), end - name.size()),
                            message.substr(end + 2)};
    }
  }
  return std::nullopt;
}

void Interpreter::throw_input_error(std::string message, std::string location) const {
  // An error that passed through coroutines has several locations in front. Keep the innermost, the last one.
  while (auto located = split_location(message)) {
    location = std::move(located->location);
    message = std::move(located->message);
  }
  throw scene::InputError(to_single_line(location) + ": " + to_single_line(message));
}

void push_error(Sandbox& sandbox, lua_State* L, const std::exception& e) {
  if (dynamic_cast<const ScriptError*>(&e) == nullptr &&
      dynamic_cast<const scene::InputError*>(&e) == nullptr)
    sandbox.interpreter->defer_exception(std::current_exception());
  const std::string location = sandbox.interpreter->current_location(L);
  const std::string text = location.empty() ? e.what() : location + ": " + e.what();
  if (dynamic_cast<const LimitError*>(&e) != nullptr) sandbox.interpreter->end_call(L, text);
  lua_pushlstring(L, text.data(), text.size());
}

}  // namespace smartsurf::script
