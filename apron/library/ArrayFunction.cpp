#include "apron/library/ArrayFunction.h"

#include <algorithm>
#include <iterator>

#include "apron/program/Reachability.h"
#include "common/error/UserError.h"

namespace apron::library {

using program::Opcode;
using program::OperandKind;

namespace {

// By register: whether an instruction may write it.
std::vector<bool> written_registers(const program::Program& program) {
  std::vector<bool> written(program.registers.size(), false);
  for (const program::Instruction& instruction : program.code) {
    if (instruction.destination.kind == OperandKind::kRegister) written[instruction.destination.index] = true;
    if (instruction.op != Opcode::kResSetReg && instruction.op != Opcode::kMatrixProduct) continue;
    for (const std::uint32_t member : program.groups[instruction.operands[0].index].members)
      written[member] = true;
  }
  return written;
}

// By register: whether an instruction may read it.
std::vector<bool> read_registers(const program::Program& program) {
  std::vector<bool> read(program.registers.size(), false);
  for (const program::Instruction& instruction : program.code)
    for (const program::Operand& operand : instruction.operands) {
      if (operand.kind == OperandKind::kRegister) read[operand.index] = true;
      if (operand.kind == OperandKind::kGroup)
        for (const std::uint32_t member : program.groups[operand.index].members)
          if (member < read.size()) read[member] = true;  // of registers or of scalars
    }
  return read;
}

vm::VmOptions vm_options(const FunctionOptions& options) {
  vm::VmOptions result;
  result.threads = options.threads;
  result.isa = options.isa;
  result.refuse_endless_ticks = options.ticks.has_value();
  result.fusion.observed = {false, {}, options.results};
  return result;
}

// Instructions between two returns of advance(), so that a caller can interrupt a long run.
std::uint64_t instructions_per_advance(const program::Program& program) {
  constexpr std::uint64_t kMinimum = 4096, kMaximum = std::uint64_t{1} << 20, kCells = std::uint64_t{1} << 32;
  return std::clamp(kCells / program::max_register_cells(program), kMinimum, kMaximum);
}

}  // namespace

FunctionSignature find_signature(const program::Program& program) {
  const std::vector<bool> written = written_registers(program), read = read_registers(program);
  FunctionSignature signature;
  for (std::uint32_t i = 0; i < program.registers.size(); ++i)
    if (program::is_user_name(program.registers[i].name))
      (written[i] ? signature.outputs : signature.inputs).push_back(i);
  std::ranges::copy_if(signature.inputs, std::back_inserter(signature.needed),
                       [&](std::uint32_t i) { return read[i]; });
  for (std::uint32_t i = 0; i < program.variables.size(); ++i)
    if (program::is_user_name(program.variables[i].name)) signature.scalars.push_back(i);
  return signature;
}

ArrayFunction::ArrayFunction(program::Program program, const FunctionOptions& options,
                             EmbeddedHost::Print print)
    : host_(std::move(print)),
      ticks_(options.ticks),
      vm_(std::move(program), vm_options(options), host_),
      is_written_(written_registers(vm_.program())),
      blocks_(vm_.program().registers.size()),
      has_input_(vm_.program().registers.size()),
      budget_(instructions_per_advance(vm_.program())) {
  const vm::FlowAnalysis flow(vm_.program(), {false, {}, options.results});
  for (std::uint32_t i = 0; i < vm_.program().registers.size(); ++i)
    if (flow.is_live(0, i)) zeroed_.push_back(i);
  bound_.reserve(vm_.program().registers.size());
}

void ArrayFunction::start(ParameterValues parameters) {
  vm_.restart();
  host_.restart();
  host_.set_parameters(std::move(parameters));
  ticks_done_ = 0;
  has_input_.assign(has_input_.size(), false);
}

vm::Plane ArrayFunction::input(std::uint32_t reg) {
  has_input_[reg] = true;
  return vm_.plane(reg);
}

void ArrayFunction::set_input(std::uint32_t reg, double value) {
  has_input_[reg] = true;
  vm_.fill_register(reg, value);
}

bool ArrayFunction::bind_input(std::uint32_t reg, const PlaneBlock& block) {
  if (is_written_[reg] || !vm_.keeps_padding() || !block.has_zero_padding() ||
      !vm::same_shape_and_type(block.plane(), vm_.plane(reg)))
    return false;
  has_input_[reg] = true;
  bound_.emplace_back(reg, vm_.bind_register(reg, {block.plane(), {}}));
  return true;
}

bool ArrayFunction::bind_result(std::uint32_t reg, PlaneBlock& block) {
  const bool is_bound = std::ranges::any_of(
      bound_, [&](const auto& other) { return vm_.plane(other.first).data == block.plane().data; });
  if (is_bound || has_input_[reg] || vm_.has_back_buffer(reg) ||
      !vm::same_shape_and_type(block.plane(), vm_.plane(reg)) ||
      (vm_.keeps_padding() && !block.has_zero_padding()))
    return false;
  if (!vm_.keeps_padding()) block.mark_padding_written();
  bound_.emplace_back(reg, vm_.bind_register(reg, {block.plane(), {}}));
  return true;
}

bool ArrayFunction::advance() {
  if (vm_.instructions_executed() == 0)
    for (const std::uint32_t reg : zeroed_)
      if (!has_input_[reg]) vm_.fill_register(reg, 0.0F);
  const std::uint64_t end = vm_.instructions_executed() + budget_;
  while (vm_.instructions_executed() < end) {
    switch (vm_.run(end - vm_.instructions_executed())) {
      case vm::Status::kTick:
        if (++ticks_done_ == ticks_) return false;
        break;
      case vm::Status::kRunning:
        return true;
      case vm::Status::kEnded:
      case vm::Status::kClosed:
        return false;
      default:
        throw common::UserError(vm_.error());
    }
  }
  return true;
}

SharedBlock ArrayFunction::new_block(const vm::ConstPlane& like) const {
  SharedBlock block = acquire_block(like.width, like.height, like.type);
  if (!vm_.keeps_padding()) block->mark_padding_written();
  return block;
}

ArrayFunction::OwnedBlocks& ArrayFunction::own_blocks(std::uint32_t reg) {
  OwnedBlocks& blocks = blocks_[reg];
  if (blocks.front) return blocks;
  // The program has just run in its own storage, from which the cells move over.
  const vm::ConstPlane cells = vm_.plane(reg);
  blocks.front = new_block(cells);
  if (vm_.has_back_buffer(reg)) blocks.back = new_block(cells);
  for (std::uint32_t y = 0; y < cells.height; ++y)
    std::copy_n(cells.row_bytes(y), cells.width * cells.cell_bytes(), blocks.front->plane().row_bytes(y));
  vm_.bind_register(reg, {blocks.front->plane(), blocks.back ? blocks.back->plane() : vm::Plane()});
  return blocks;
}

SharedBlock ArrayFunction::take_result(std::uint32_t reg) {
  OwnedBlocks& blocks = own_blocks(reg);
  if (blocks.back && vm_.plane(reg).data == blocks.back->plane().data) std::swap(blocks.front, blocks.back);
  const vm::Plane plane = vm_.plane(reg);
  SharedBlock next = new_block(plane);
  vm_.bind_register(reg, {next->plane(), {}});
  return std::exchange(blocks.front, std::move(next));
}

void ArrayFunction::finish() noexcept {
  for (const auto& [reg, storage] : bound_) vm_.bind_register(reg, storage);
  bound_.clear();
}

}  // namespace apron::library
