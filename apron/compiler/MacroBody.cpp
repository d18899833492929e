#include "apron/compiler/MacroBody.h"

#include <algorithm>
#include <set>
#include <utility>

#include "apron/compiler/Builtins.h"

namespace apron::compiler {
namespace {

using syntax::Expression;
using syntax::ExpressionKind;
using syntax::Statement;
using syntax::StatementKind;

bool is_place(const Expression& expression) {
  return expression.kind == ExpressionKind::kName || expression.kind == ExpressionKind::kElement;
}

class Scan {
 public:
  MacroBody run(std::span<const Statement> body) {
    visit(body);
    body_.is_self_contained &= body_.closes_its_blocks;
    for (const std::string& label : jumps_) body_.is_self_contained &= labels_.contains(label);
    return std::move(body_);
  }

 private:
  void visit(std::span<const Statement> statements) {
    int open_blocks = 0, open_loops = 0;
    for (const Statement& statement : statements) {
      if (statement.kind == StatementKind::kLabel) labels_.insert(statement.target.text);
      if (statement.kind == StatementKind::kMacroEnd) continue;
      visit(statement.value);
      if (statement.expansion != nullptr)
        for (const syntax::ArgumentBinding& binding : statement.expansion->bindings) visit(binding.value);
      if (statement.kind == StatementKind::kCall) visit_call(statement.value, open_blocks, open_loops);
      if (statement.kind == StatementKind::kInvalid && !statement.assigns)
        visit_call(statement.target, open_blocks, open_loops);
      body_.last_target = written_target(statement);
      if (body_.last_target != nullptr) body_.targets.push_back(body_.last_target);
    }
    body_.closes_its_blocks &= open_blocks == 0;
  }

  // An expression may hold macros, whose bodies are statements.
  void visit(const Expression& expression) {
    for (const Expression& child : expression.children) visit(child);
    if (expression.expansion == nullptr) return;
    for (const syntax::ArgumentBinding& binding : expression.expansion->bindings) visit(binding.value);
    visit(expression.expansion->body);
  }

  void visit_call(const Expression& call, int& open_blocks, int& open_loops) {
    const Builtin* builtin = find_builtin(call.text);
    if (builtin == nullptr) return;
    if (const auto opened = builtin->opened_block()) {
      ++open_blocks;
      if (is_loop(*opened)) ++open_loops;
    } else if (const auto closed = builtin->closed_block()) {
      if (--open_blocks < 0) body_.closes_its_blocks = false;
      if (is_loop(*closed)) --open_loops;
    }
    for (const Expression& argument : call.children)
      if (argument.kind == ExpressionKind::kLabel) jumps_.push_back(argument.text);
    const bool leaves_loop =
        (builtin->form == BuiltinForm::kBreak || builtin->form == BuiltinForm::kContinue) && open_loops == 0;
    const bool leaves =
        leaves_loop || builtin->form == BuiltinForm::kReturn || builtin->op == program::Opcode::kEnd;
    if (leaves) body_.is_self_contained = false;
    if (builtin->op == program::Opcode::kResSetReg && call.children.size() == 3)
      body_.class_writes.push_back(&call);
    if (builtin->op == program::Opcode::kMaskOn || builtin->op == program::Opcode::kMaskOff)
      body_.sets_base_mask = true;
  }

  static bool is_loop(BlockKind kind) {
    return kind == BlockKind::kWhile || kind == BlockKind::kFor || kind == BlockKind::kRepeat;
  }

  MacroBody body_;
  std::set<std::string> labels_;
  std::vector<std::string> jumps_;
};

bool mentions(const Expression& expression, const std::string& name) {
  const auto in_binding = [&](const syntax::ArgumentBinding& binding) {
    return mentions(binding.value, name);
  };
  return (expression.kind == ExpressionKind::kName && expression.text == name) ||
         std::ranges::any_of(expression.children,
                             [&](const Expression& child) { return mentions(child, name); }) ||
         (expression.expansion != nullptr &&
          (std::ranges::any_of(expression.expansion->bindings, in_binding) ||
           compiler::mentions(expression.expansion->body, name)));
}

// pixel.set(y, …) and mac(y, a, b) depend on what y was.
bool keeps_some_cells(const Expression& call) {
  const Builtin* builtin = find_builtin(call.text);
  return builtin->form == BuiltinForm::kPixelSet || builtin->form == BuiltinForm::kMac;
}

}  // namespace

bool mentions(std::span<const Statement> statements, const std::string& name) {
  return std::ranges::any_of(statements, [&](const Statement& statement) {
    const Expression* target = statement.kind == StatementKind::kCall ? written_target(statement) : nullptr;
    const bool keeps = target != nullptr && keeps_some_cells(statement.value);
    const auto in_argument = [&](const Expression& argument) {
      return (&argument != target || keeps) && mentions(argument, name);
    };
    const auto in_binding = [&](const syntax::ArgumentBinding& binding) {
      return mentions(binding.value, name);
    };
    if (statement.expansion != nullptr && std::ranges::any_of(statement.expansion->bindings, in_binding))
      return true;
    return target != nullptr ? std::ranges::any_of(statement.value.children, in_argument)
                             : mentions(statement.value, name);
  });
}

const Expression* written_target(const Statement& statement) {
  if (statement.kind == StatementKind::kAssign) return &statement.target;
  if (statement.kind != StatementKind::kCall) return nullptr;
  const Expression& call = statement.value;
  const Builtin* builtin = find_builtin(call.text);
  const int written = builtin == nullptr ? -1 : builtin->written_argument(call.children.size());
  if (written < 0) return nullptr;
  std::size_t place = written;
  // surface.sense('name', D) is surface.sense(D, 'name').
  if (builtin->op == program::Opcode::kSurfaceSense && call.children.size() > 1 &&
      call.children[0].kind == ExpressionKind::kString)
    place = 1;
  if (!is_place(call.children[place])) return nullptr;
  return &call.children[place];
}

MacroBody scan_macro_body(std::span<const Statement> body) { return Scan().run(body); }

}  // namespace apron::compiler
