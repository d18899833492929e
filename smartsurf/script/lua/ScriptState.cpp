#include "smartsurf/script/lua/ScriptState.h"

#include <algorithm>
#include <iterator>
#include <string>
#include <string_view>
#include <vector>

#include "common/hash/Fnv.h"
#include "smartsurf/script/lua/Userdata.h"

namespace smartsurf::script {
namespace {

// Registry: the numbered objects as a list, and the number of each.
constexpr const char* kObjects = "smartsurf.objects";
constexpr const char* kNumbers = "smartsurf.numbers";
constexpr const char* kModules = "smartsurf.modules";  // of require, see SandboxFiles.cpp
// The types of handles, see Userdata.h.
constexpr const char* kHandleTypes[] = {"object", "joint"};

enum class Tag : std::uint8_t { kNil, kFalse, kTrue, kInteger, kNumber, kString, kReference, kHandle };

bool is_reference(int type) {
  return type == LUA_TTABLE || type == LUA_TFUNCTION || type == LUA_TUSERDATA || type == LUA_TTHREAD;
}

// The number of the value on top in the table at an absolute stack index; 0 if it has none.
std::int64_t number_in(lua_State* L, int numbers) {
  lua_pushvalue(L, -1);
  lua_rawget(L, numbers);
  const auto number = static_cast<std::int64_t>(lua_tointeger(L, -1));
  lua_pop(L, 1);
  return number;
}

// Visits objects breadth first: a list on the stack holds them in the order of their numbers, from 1.
class Numbering {
 public:
  // `objects` and `numbers`: absolute stack indices of the two tables.
  Numbering(lua_State* L, int objects, int numbers, std::int64_t count)
      : L_(L), objects_(objects), numbers_(numbers), count_(count) {}

  std::int64_t count() const { return count_; }

  // Numbers the value on top, if it is an object without a number, and pops it. Returns its number, 0 for
  // others.
  std::int64_t take() {
    std::int64_t number = 0;
    if (is_reference(lua_type(L_, -1))) {
      number = number_in(L_, numbers_);
      if (number == 0) {
        number = ++count_;
        lua_pushvalue(L_, -1);
        lua_rawseti(L_, objects_, number);
        lua_pushvalue(L_, -1);
        lua_pushinteger(L_, number);
        lua_rawset(L_, numbers_);
      }
    }
    lua_pop(L_, 1);
    return number;
  }

 private:
  lua_State* L_;
  int objects_, numbers_;
  std::int64_t count_;
};

void push_modules(lua_State* L) { luaL_getsubtable(L, LUA_REGISTRYINDEX, kModules); }

// By slot of Sandbox::callbacks.
std::vector<bool> free_slots(const Sandbox& sandbox) {
  std::vector<bool> is_free(sandbox.callbacks.size(), false);
  for (const int slot : sandbox.free_callbacks) is_free[slot] = true;
  return is_free;
}

void number_roots(Sandbox* sandbox, lua_State* L, Numbering& numbering) {
  lua_pushglobaltable(L);
  numbering.take();
  push_modules(L);
  numbering.take();
  if (sandbox == nullptr) return;
  const std::vector<bool> is_free = free_slots(*sandbox);
  for (std::size_t i = 0; i < sandbox->callbacks.size(); ++i) {
    if (is_free[i]) continue;
    lua_rawgeti(L, LUA_REGISTRYINDEX, sandbox->callbacks[i].reference);
    numbering.take();
  }
}

// Calls visit() with each key and its value on the stack, which visit() pops. `table`: absolute stack index.
// The order does not depend on addresses, unless objects are keys: string keys by their bytes, then the
// others as Lua gives them.
template <class Visit>
void for_each_field(lua_State* L, int table, Visit visit) {
  std::vector<std::string_view> names;
  for (lua_pushnil(L); lua_next(L, table) != 0; lua_pop(L, 1)) {
    if (lua_type(L, -2) != LUA_TSTRING) continue;
    std::size_t length = 0;
    const char* const text = lua_tolstring(L, -2, &length);
    names.emplace_back(text, length);
  }
  std::ranges::sort(names);
  for (const std::string_view name : names) {
    lua_pushlstring(L, name.data(), name.size());
    lua_pushvalue(L, -1);
    lua_rawget(L, table);
    visit();
  }
  for (lua_pushnil(L); lua_next(L, table) != 0;) {
    if (lua_type(L, -2) == LUA_TSTRING) {
      lua_pop(L, 1);
      continue;
    }
    lua_pushvalue(L, -2);
    lua_insert(L, -2);
    visit();
  }
}

// Numbers what the table on top refers to.
void number_table(lua_State* L, Numbering& numbering) {
  const int table = lua_gettop(L);
  if (lua_getmetatable(L, table) != 0) numbering.take();
  for_each_field(L, table, [&] { numbering.take(), numbering.take(); });
}

void number_object(lua_State* L, Numbering& numbering) {
  switch (lua_type(L, -1)) {
    case LUA_TTABLE:
      number_table(L, numbering);
      break;
    case LUA_TFUNCTION:
      for (int i = 1; lua_getupvalue(L, -1, i) != nullptr; ++i) numbering.take();
      break;
    case LUA_TUSERDATA:
      if (lua_getmetatable(L, -1) != 0) numbering.take();
      break;
    default:
      break;
  }
}

void mix(std::uint64_t& hash, std::uint64_t value) { hash = common::fnv_mix(hash, value); }

// A description of the object on top that does not depend on addresses.
std::uint64_t describe(lua_State* L) {
  std::uint64_t hash = static_cast<std::uint64_t>(lua_type(L, -1));
  if (lua_type(L, -1) != LUA_TFUNCTION) return hash;
  lua_Debug ar;
  lua_pushvalue(L, -1);
  lua_getinfo(L, ">Su", &ar);
  mix(hash, static_cast<std::uint64_t>(ar.linedefined));
  mix(hash, ar.nups);
  return hash;
}

std::int64_t number_all(Sandbox* sandbox, lua_State* L, std::int64_t count, std::uint64_t& fingerprint) {
  luaL_getsubtable(L, LUA_REGISTRYINDEX, kObjects);
  luaL_getsubtable(L, LUA_REGISTRYINDEX, kNumbers);
  const int objects = lua_gettop(L) - 1;
  Numbering numbering(L, objects, objects + 1, count);
  number_roots(sandbox, L, numbering);
  // The globals and the modules, objects 1 and 2, are visited again: the script may have added to them.
  for (std::int64_t i = 1; i <= numbering.count(); i = i == 2 && count > 2 ? count + 1 : i + 1) {
    lua_rawgeti(L, objects, i);
    mix(fingerprint, describe(L));
    number_object(L, numbering);
    lua_pop(L, 1);
  }
  lua_pop(L, 2);
  return numbering.count();
}

[[noreturn]] void throw_unsavable(lua_State* L, const char* what) {
  std::string where;
  if (lua_type(L, -1) == LUA_TFUNCTION) {
    lua_Debug ar;
    lua_pushvalue(L, -1);
    lua_getinfo(L, ">S", &ar);
    if (ar.linedefined > 0)
      where = " (" + std::string(ar.short_src) + ":" + std::to_string(ar.linedefined) + ")";
  }
  throw ScriptError(
      "save: the script holds " + std::string(what) + where +
      ", created while the simulation ran, which cannot be saved: create it while the script loads");
}

// One pass of saving: values refer to objects by number, new tables follow the known objects.
class Writer {
 public:
  Writer(lua_State* L, common::StateArchive& out, std::int64_t library_count, std::int64_t known_count)
      : L_(L), out_(out), library_count_(library_count), known_count_(known_count), next_(known_count) {
    luaL_getsubtable(L, LUA_REGISTRYINDEX, kObjects);
    luaL_getsubtable(L, LUA_REGISTRYINDEX, kNumbers);
    lua_newtable(L);  // number of each object visited so far that has none of its own
    lua_newtable(L);  // the objects to save, in the order of discovery
    objects_ = lua_gettop(L) - 3;
    queued_.assign(known_count + 1, false);
  }
  ~Writer() { lua_settop(L_, objects_ - 1); }
  Writer(const Writer&) = delete;
  Writer& operator=(const Writer&) = delete;

  // Saves the value on top and pops it.
  void write_value() {
    switch (lua_type(L_, -1)) {
      case LUA_TNIL:
        tag(Tag::kNil);
        break;
      case LUA_TBOOLEAN:
        tag(lua_toboolean(L_, -1) != 0 ? Tag::kTrue : Tag::kFalse);
        break;
      case LUA_TNUMBER:
        if (lua_isinteger(L_, -1) != 0)
          tag(Tag::kInteger), out_.value(lua_tointeger(L_, -1));
        else
          tag(Tag::kNumber), out_.value(lua_tonumber(L_, -1));
        break;
      case LUA_TSTRING: {
        std::size_t length = 0;
        const char* const text = lua_tolstring(L_, -1, &length);
        tag(Tag::kString);
        out_.value(std::string(text, length));
        break;
      }
      case LUA_TUSERDATA:
        if (write_handle()) break;
        [[fallthrough]];
      default:
        tag(Tag::kReference), out_.value(number());
        break;
    }
    lua_pop(L_, 1);
  }

  // Saves the objects that the values referred to, and those that these refer to.
  void write_objects() {
    for (lua_Integer i = 1; i <= queue_length_; ++i) {
      lua_rawgeti(L_, objects_ + 3, i);
      lua_pushvalue(L_, -1);
      out_.value(number());
      lua_pop(L_, 1);
      if (lua_type(L_, -1) == LUA_TTABLE)
        write_table();
      else if (lua_type(L_, -1) == LUA_TFUNCTION)
        write_upvalues();
      lua_pop(L_, 1);
    }
    out_.value(std::int64_t{0});
    out_.value(next_);
  }

 private:
  void tag(Tag t) { out_.value(t); }

  // Returns false if the value on top is not a handle.
  bool write_handle() {
    for (std::uint8_t type = 0; type < std::size(kHandleTypes); ++type) {
      const scene::ObjectId* const id = test_handle(L_, -1, kHandleTypes[type]);
      if (id == nullptr) continue;
      tag(Tag::kHandle), out_.value(handle_number()), out_.value(type), out_.value(*id);
      return true;
    }
    return false;
  }

  // The number of the handle on top. Handles can be keys of tables, so their identity matters.
  std::int64_t handle_number() {
    const std::int64_t number = number_in(L_, objects_ + 2);
    return number > 0 ? number : give_number();
  }

  std::int64_t give_number() {
    lua_pushvalue(L_, -1);
    lua_pushinteger(L_, ++next_);
    lua_rawset(L_, objects_ + 2);
    return next_;
  }

  // The number of the object on top, which is queued if it is new and not constant.
  std::int64_t number() {
    std::int64_t known = number_in(L_, objects_ + 1);
    if (known > 0) {
      const bool is_constant = known > 2 && known <= library_count_;
      const int type = lua_type(L_, -1);
      if (!is_constant && !queued_[known] && (type == LUA_TTABLE || type == LUA_TFUNCTION)) {
        queued_[known] = true;
        enqueue();
      }
      return known;
    }
    known = number_in(L_, objects_ + 2);
    if (known > 0) return known;
    if (lua_type(L_, -1) == LUA_TFUNCTION) throw_unsavable(L_, "a function");
    if (lua_type(L_, -1) == LUA_TTHREAD) throw_unsavable(L_, "a coroutine");
    if (lua_type(L_, -1) != LUA_TTABLE) throw_unsavable(L_, "an open file");
    give_number();
    enqueue();
    return next_;
  }

  void enqueue() {
    lua_pushvalue(L_, -1);
    lua_rawseti(L_, objects_ + 3, ++queue_length_);
  }

  void write_table() {
    const int table = lua_gettop(L_);
    if (lua_getmetatable(L_, table) == 0) lua_pushnil(L_);
    write_value();
    for_each_field(L_, table, [this] {
      lua_pushvalue(L_, -2);
      write_value();  // the key
      write_value();
      lua_pop(L_, 1);
    });
    tag(Tag::kNil);  // no key
  }

  void write_upvalues() {
    for (int i = 1; lua_getupvalue(L_, -1, i) != nullptr; ++i) write_value();
  }

  lua_State* L_;
  common::StateArchive& out_;
  std::int64_t library_count_, known_count_, next_;
  int objects_;
  lua_Integer queue_length_ = 0;
  std::vector<bool> queued_;  // by number
};

class Reader {
 public:
  Reader(lua_State* L, common::StateArchive& in, std::int64_t known_count)
      : L_(L), in_(in), known_count_(known_count) {
    luaL_getsubtable(L, LUA_REGISTRYINDEX, kObjects);
    lua_newtable(L);  // the new tables, by number − known_count
    objects_ = lua_gettop(L) - 1;
  }
  ~Reader() { lua_settop(L_, objects_ - 1); }
  Reader(const Reader&) = delete;
  Reader& operator=(const Reader&) = delete;

  // Pushes a value. Returns whether it is not nil.
  bool push_value() {
    switch (in_.value(Tag::kNil)) {
      case Tag::kNil:
        lua_pushnil(L_);
        return false;
      case Tag::kFalse:
        lua_pushboolean(L_, 0);
        break;
      case Tag::kTrue:
        lua_pushboolean(L_, 1);
        break;
      case Tag::kInteger:
        lua_pushinteger(L_, in_.value(lua_Integer{0}));
        break;
      case Tag::kNumber:
        lua_pushnumber(L_, in_.value(lua_Number{0}));
        break;
      case Tag::kString: {
        const std::string text = in_.value(std::string());
        lua_pushlstring(L_, text.data(), text.size());
        break;
      }
      case Tag::kHandle:
        push_saved_handle();
        break;
      case Tag::kReference:
        push_object(in_.value(std::int64_t{0}));
        break;
      default:
        throw common::UserError("the saved state is damaged");
    }
    return true;
  }

  void read_objects() {
    while (const auto number = in_.value(std::int64_t{0})) {
      push_object(number);
      if (lua_type(L_, -1) == LUA_TTABLE)
        read_table();
      else if (lua_type(L_, -1) == LUA_TFUNCTION)
        read_upvalues();
      lua_pop(L_, 1);
    }
    in_.value(std::int64_t{0});
  }

 private:
  // Pushes a known object, or the new table with that number.
  void push_object(std::int64_t number) {
    if (number < 1) throw common::UserError("the saved state is damaged");
    if (number <= known_count_) {
      lua_rawgeti(L_, objects_, number);
      return;
    }
    lua_rawgeti(L_, objects_ + 1, number - known_count_);
    if (!lua_isnil(L_, -1)) return;
    lua_pop(L_, 1);
    lua_newtable(L_);
    lua_pushvalue(L_, -1);
    lua_rawseti(L_, objects_ + 1, number - known_count_);
  }

  void push_saved_handle() {
    const auto number = in_.value(std::int64_t{0});
    const auto type = in_.value(std::uint8_t{0});
    if (type >= std::size(kHandleTypes)) throw common::UserError("the saved state is damaged");
    const auto id = in_.value(scene::ObjectId{0});
    lua_rawgeti(L_, objects_ + 1, number - known_count_);
    if (!lua_isnil(L_, -1)) return;
    lua_pop(L_, 1);
    push_handle(L_, kHandleTypes[type], id);
    lua_pushvalue(L_, -1);
    lua_rawseti(L_, objects_ + 1, number - known_count_);
  }

  void read_table() {
    const int table = lua_gettop(L_);
    for (lua_pushnil(L_); lua_next(L_, table) != 0;) {
      lua_pop(L_, 1);
      lua_pushvalue(L_, -1);
      lua_pushnil(L_);
      lua_rawset(L_, table);
    }
    push_value();
    lua_setmetatable(L_, table);
    while (push_value()) {
      push_value();
      lua_rawset(L_, table);
    }
    lua_pop(L_, 1);
  }

  void read_upvalues() {
    const int function = lua_gettop(L_);
    for (int i = 1; lua_getupvalue(L_, function, i) != nullptr; ++i) {
      lua_pop(L_, 1);
      push_value();
      lua_setupvalue(L_, function, i);
    }
  }

  lua_State* L_;
  common::StateArchive& in_;
  std::int64_t known_count_;
  int objects_;
};

}  // namespace

void ScriptState::number_library(lua_State* L) { library_count_ = number_all(nullptr, L, 0, fingerprint_); }

void ScriptState::number_script(Sandbox& sandbox, lua_State* L) {
  known_count_ = number_all(&sandbox, L, library_count_, fingerprint_);
  mix(fingerprint_, *sandbox.files_hash);
  sandbox.files_hash.reset();
}

void ScriptState::save(Sandbox& sandbox, lua_State* L, common::StateArchive& a) {
  Writer writer(L, a, library_count_, known_count_);
  lua_pushglobaltable(L);
  writer.write_value();
  push_modules(L);
  writer.write_value();
  a.value(static_cast<std::uint64_t>(sandbox.callbacks.size()));
  const std::vector<bool> is_free = free_slots(sandbox);
  for (std::size_t i = 0; i < sandbox.callbacks.size(); ++i) {
    a(sandbox.callbacks[i].location);
    if (is_free[i])
      lua_pushnil(L);
    else
      lua_rawgeti(L, LUA_REGISTRYINDEX, sandbox.callbacks[i].reference);
    writer.write_value();
  }
  writer.write_objects();
}

void ScriptState::restore(Sandbox& sandbox, lua_State* L, common::StateArchive& a) {
  const std::vector<bool> is_free = free_slots(sandbox);
  for (std::size_t i = 0; i < sandbox.callbacks.size(); ++i)
    if (!is_free[i]) luaL_unref(L, LUA_REGISTRYINDEX, sandbox.callbacks[i].reference);
  sandbox.callbacks.clear();
  sandbox.free_callbacks.clear();
  Reader reader(L, a, known_count_);
  reader.push_value();
  reader.push_value();
  lua_pop(L, 2);
  const auto count = a.value(std::uint64_t{0});
  for (std::uint64_t i = 0; i < count; ++i) {
    Callback callback;
    a(callback.location);
    if (reader.push_value()) {
      callback.reference = luaL_ref(L, LUA_REGISTRYINDEX);
    } else {
      lua_pop(L, 1);
      sandbox.free_callbacks.push_back(static_cast<int>(i));
    }
    sandbox.callbacks.push_back(std::move(callback));
  }
  reader.read_objects();
}

}  // namespace smartsurf::script
