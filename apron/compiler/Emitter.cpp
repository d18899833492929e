#include "apron/compiler/Emitter.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <utility>

namespace apron::compiler {

using program::Operand;
using program::OperandKind;

program::Source Emitter::source(const syntax::Location& at, const std::string& file) {
  const auto [found, added] =
      file_index_.try_emplace(file, static_cast<std::uint32_t>(program_.files.size()));
  if (added) program_.files.push_back(file);
  return {found->second, at.line, at.column, at.expansion};
}

void Emitter::at(const syntax::Location& at, const std::string& file) {
  here_ = at;
  const program::Source wanted = source(at, file);
  if (program_.sources.empty() || program_.sources.back() != wanted) program_.sources.push_back(wanted);
}

void Emitter::add_expansion(const std::string& macro, const syntax::Location& call, const std::string& file) {
  program_.expansions.push_back({macro, source(call, file)});
}

std::uint32_t Emitter::add_register(std::string name, Shape shape) {
  const std::uint64_t cells = std::uint64_t{shape.width} * shape.height;
  if (cells > program::kMaxCells) {
    throw Failure{here_, fmt::format("a register of {}x{} has more than {} cells", shape.width, shape.height,
                                     program::kMaxCells)};
  }
  if (program_.registers.size() >= program::kMaxRegisters) {
    throw Failure{here_, fmt::format("the program needs more than {} registers", program::kMaxRegisters)};
  }
  memory_ += cells * sizeof(float);
  if (memory_ > program::kMaxMemory) {
    throw Failure{here_, fmt::format("the registers take more than {} bytes", program::kMaxMemory)};
  }
  program_.registers.push_back({std::move(name), shape.width, shape.height});
  return static_cast<std::uint32_t>(program_.registers.size() - 1);
}

std::uint32_t Emitter::add_variable(std::string name) {
  program_.variables.push_back({std::move(name), 0.0F});
  return static_cast<std::uint32_t>(program_.variables.size() - 1);
}

Value Emitter::temporary(Shape shape) {
  std::vector<std::uint32_t>& free = pools_[shape].free;
  Value value{Value::Kind::kRegister, 0, 0.0F, true};
  if (free.empty()) {
    value.index = add_register(fmt::format("${}", temporaries_), shape);
    ++temporaries_;
  } else {
    const auto lowest = std::min_element(free.begin(), free.end());
    value.index = *lowest;
    free.erase(lowest);
  }
  live_.push_back(value);
  return value;
}

Value Emitter::temporary_variable() {
  Value value{Value::Kind::kVariable, 0, 0.0F, true};
  if (free_variables_.empty()) {
    value.index = add_variable(fmt::format("${}", temporaries_++));
  } else {
    const auto lowest = std::min_element(free_variables_.begin(), free_variables_.end());
    value.index = *lowest;
    free_variables_.erase(lowest);
  }
  live_.push_back(value);
  return value;
}

void Emitter::drop_live(const Value& value) {
  const auto found = std::find_if(live_.rbegin(), live_.rend(), [&](const Value& live) {
    return live.kind == value.kind && live.index == value.index;
  });
  if (found != live_.rend()) live_.erase(std::next(found).base());
}

void Emitter::release(const Value& value) {
  if (!value.temporary) return;
  drop_live(value);
  std::vector<std::uint32_t>& free = value.is_register() ? pools_[shape(value)].free : free_variables_;
  if (std::find(free.begin(), free.end(), value.index) == free.end()) free.push_back(value.index);
}

void Emitter::release_to(std::size_t mark) {
  while (live_.size() > mark) release(Value(live_.back()));
}

void Emitter::keep(const Value& value) {
  if (value.temporary) drop_live(value);
}

void Emitter::unkeep(const Value& value) {
  if (value.temporary) live_.push_back(value);
}

Operand Emitter::operand(const Value& value) {
  switch (value.kind) {
    case Value::Kind::kRegister:
      return {OperandKind::kRegister, value.index};
    case Value::Kind::kVariable:
      return {OperandKind::kVariable, value.index};
    case Value::Kind::kConstant:
      return literal(value.constant);
    case Value::Kind::kNothing:
      break;
  }
  return {};
}

Operand Emitter::literal(float value) {
  const auto next = static_cast<std::uint32_t>(program_.literals.size());
  const auto [found, added] = literal_index_.try_emplace(std::bit_cast<std::uint32_t>(value), next);
  if (added) program_.literals.push_back(value);
  return {OperandKind::kLiteral, found->second};
}

Operand Emitter::text(const std::string& value) {
  const auto [found, added] =
      text_index_.try_emplace(value, static_cast<std::uint32_t>(program_.texts.size()));
  if (added) program_.texts.push_back(value);
  return {OperandKind::kText, found->second};
}

Shape Emitter::shape(const Value& value) const {
  if (!value.is_register()) return {};
  const program::Register& reg = program_.registers[value.index];
  return {reg.width, reg.height};
}

void Emitter::emit(program::Opcode op, Operand destination, std::vector<Operand> operands, bool masked) {
  if (program_.code.size() + 1 >= program::kMaxInstructions) {
    throw Failure{here_, fmt::format("the program has more than {} instructions", program::kMaxInstructions)};
  }
  program::Instruction instruction;
  instruction.op = op;
  instruction.masked = masked;
  instruction.source = program_.sources.empty() ? 0 : static_cast<std::uint32_t>(program_.sources.size() - 1);
  instruction.destination = destination;
  std::copy(operands.begin(), operands.end(), instruction.operands.begin());
  program_.code.push_back(instruction);
}

bool Emitter::redirect(const Value& temporary, const Value& place) {
  if (!temporary.temporary || program_.code.empty() || last_target_ == position()) return false;
  program::Instruction& last = program_.code.back();
  const Operand wanted = operand(place);
  const bool fits = last.destination == operand(temporary) && temporary.kind == place.kind;
  const bool reads_it = std::find(last.operands.begin(), last.operands.end(), wanted) != last.operands.end();
  const bool clashes = reads_it && program::is_out_of_place(last.op);
  if (!fits || last.op == program::Opcode::kPixelSet || clashes) return false;
  last.destination = wanted;
  last.masked = true;
  return true;
}

Emitter::Label Emitter::new_label() {
  labels_.push_back(0);
  return static_cast<Label>(labels_.size() - 1);
}

void Emitter::place(Label label) {
  labels_[label] = static_cast<std::uint32_t>(program_.code.size());
  last_target_ = program_.code.size();
}

Operand Emitter::label(Label label) const { return {OperandKind::kLabel, label}; }

program::Program Emitter::finish() {
  program::Instruction end;
  end.op = program::Opcode::kEnd;
  end.source = program_.sources.empty() ? 0 : static_cast<std::uint32_t>(program_.sources.size() - 1);
  program_.code.push_back(end);
  for (program::Instruction& instruction : program_.code) {
    for (Operand& operand : instruction.operands) {
      if (operand.kind == OperandKind::kLabel) operand.index = labels_[operand.index];
    }
  }
  return std::move(program_);
}

}  // namespace apron::compiler
