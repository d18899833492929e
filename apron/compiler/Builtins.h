// The built-in statements and instructions by name: their numbers of arguments and their lowering.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "apron/program/Program.h"

namespace apron::compiler {

// How the compiler lowers a built-in. The order matters: see opened_block(), closed_block() and
// returns_value().
enum class BuiltinForm : std::uint8_t {
  kOperands,  // the arguments are the operands of the instruction, as its signature lists them
  // Values: y = f(…) and f(y, …).
  kElementwise,
  kMac,
  kConvert,
  kShift,    // by (dx, dy) times the distance
  kShiftBy,  // shift(A, dx, dy), rotate(A, dx, dy)
  kNeighbourhood,
  kMaskIf,
  kRegisterWidth,
  kRegisterHeight,
  kRegisterId,
  kParameterGet,
  kKey,
  kPropagate,
  kScatter,
  kFilterDo,
  kFilterGauss,
  kFilterGaussAni,
  kFilterEdge,
  kRandom,
  kRandomWhite,
  kRandomRounded,
  kElementMatch,
  kPlugin,
  // Statements.
  kFilterCreate,
  kFilterSet,
  kFilterFill,
  kFilterGabor,
  kTile,
  kColourMapping,
  kPixelSet,
  kMatrixProduct,
  kSurfaceActuate,
  kBoundary,
  kPrint,
  kSliderAdd,
  kSwitchAdd,
  kLabel,
  kJump,
  kJumpIf,
  kCall,
  kCallIf,
  kReturn,
  kIf,
  kWhile,
  kFor,
  kRepeat,
  kWhere,
  kEndIf,
  kEndWhile,
  kEndFor,
  kEndRepeat,
  kEndWhere,
  kElse,
  kElsewhere,
  kBreak,
  kContinue,
};

// The order is that of kIf to kWhere and of kEndIf to kEndWhere.
enum class BlockKind : std::uint8_t { kIf, kWhile, kFor, kRepeat, kWhere };

struct Builtin {
  std::string_view name = {};
  BuiltinForm form = BuiltinForm::kElementwise;
  std::uint8_t min_arguments = 0, max_arguments = 0;  // arguments, a destination not counted
  program::Opcode op = program::Opcode::kNop;
  std::int8_t dx = 0, dy = 0;                            // of one step of a shift: cells east and south
  program::CellType type = program::CellType::kFloat32;  // of kConvert
  std::string_view text_meaning = {};                    // of kOperands: what its text is, for messages

  bool returns_value() const noexcept {
    return form == BuiltinForm::kOperands ? program::opcode_info(op).signature.front() != '-'
                                          : form <= BuiltinForm::kPlugin;
  }
  // The argument that a statement with that many writes, or -1. 'surface.sense' takes its two in either
  // order.
  int written_argument(std::size_t count) const noexcept {
    if (form == BuiltinForm::kPlugin) return count > 2 ? 2 : -1;
    const bool writes = returns_value() || form == BuiltinForm::kFor || form == BuiltinForm::kPixelSet ||
                        form == BuiltinForm::kMatrixProduct;
    return writes && count > 0 ? 0 : -1;
  }
  // The kind of block that the statement opens or closes, if it does.
  std::optional<BlockKind> opened_block() const noexcept {
    if (form < BuiltinForm::kIf || form > BuiltinForm::kWhere) return std::nullopt;
    return static_cast<BlockKind>(static_cast<int>(form) - static_cast<int>(BuiltinForm::kIf));
  }
  std::optional<BlockKind> closed_block() const noexcept {
    if (form < BuiltinForm::kEndIf || form > BuiltinForm::kEndWhere) return std::nullopt;
    return static_cast<BlockKind>(static_cast<int>(form) - static_cast<int>(BuiltinForm::kEndIf));
  }
};

inline constexpr std::uint8_t kVariadic = 255;

// nullptr for an unknown name.
const Builtin* find_builtin(std::string_view name);
std::vector<std::string> builtin_names();

// The instruction behind an infix operator; kNop if there is none.
program::Opcode infix_opcode(std::string_view op);

}  // namespace apron::compiler
