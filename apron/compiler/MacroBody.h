// The effects of a macro's body on the caller's registers and masks, found before it is lowered.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "apron/syntax/Ast.h"

namespace apron::compiler {

struct MacroBody {
  // The targets of its statements, in order, those of the macros that it uses included.
  std::vector<const syntax::Expression*> targets;
  // The calls of res.setreg, which may write any register of their class.
  std::vector<const syntax::Expression*> class_writes;
  // The target of its last statement, or null: nothing in the body sees what that statement writes.
  const syntax::Expression* last_target = nullptr;
  bool sets_base_mask = false;    // by mask.on or mask.off
  bool closes_its_blocks = true;  // and no others
  // It closes its blocks, and is left at its end only.
  bool is_self_contained = true;
};

MacroBody scan_macro_body(std::span<const syntax::Statement>);

// True if a value or argument in the statements is that name.
bool mentions(std::span<const syntax::Statement>, const std::string& name);

// The target of a statement, or null.
const syntax::Expression* written_target(const syntax::Statement&);

}  // namespace apron::compiler
