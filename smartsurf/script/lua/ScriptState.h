// Saves and restores the values of a script: its globals, the local variables that its functions share, and
// the tables that these hold.
//
// Functions themselves are not saved. Those that exist after loading are numbered in an order that depends on
// the script alone; a saved state refers to them by number, so that another interpreter that has loaded the
// same script can restore it. What only a running script can create (a function, a coroutine, an open file)
// cannot be saved. The standard library counts as constant. Internal to this module.
#pragma once

#include <cstdint>

#include "common/state/StateArchive.h"
#include "smartsurf/script/lua/Interpreter.h"

namespace smartsurf::script {

class ScriptState {
 public:
  // Call both inside Interpreter::call(): when all bindings are registered, and when the script is loaded.
  void number_library(lua_State* L);
  void number_script(Sandbox&, lua_State* L);

  // Identifies the numbering and the files that the script has read while it loaded: equal for interpreters
  // that have loaded the same script.
  std::uint64_t fingerprint() const { return fingerprint_; }

  // Call inside Interpreter::call(), after number_script(). Throw ScriptError for a value that cannot be
  // saved, and common::UserError for a state that is damaged or not of this script.
  void save(Sandbox&, lua_State* L, common::StateArchive&);
  void restore(Sandbox&, lua_State* L, common::StateArchive&);

 private:
  std::int64_t library_count_ = 0, known_count_ = 0;
  std::uint64_t fingerprint_ = 0;
};

}  // namespace smartsurf::script
