// The built-in statements and instructions by name: their numbers of arguments and their lowering.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "apron/program/Program.h"

namespace apron::compiler {

enum class BuiltinForm : std::uint8_t {
  // values: y = f(…) and f(y, …)
  kElementwise,
  kMac,
  kShift,    // by (dx, dy) times the distance
  kShiftBy,  // shift(A, dx, dy), rotate(A, dx, dy)
  kNeighbourhood,
  kMaskIf,
  kReduction,
  kPixelGet,
  kCellCoordinate,
  kRegisterWidth,
  kRegisterHeight,
  kRegisterId,
  kSurfaceScalar,
  kSurfaceSense,
  kSurfaceHas,
  kFileOpen,
  kParameterGet,
  kTimerRead,
  kKey,
  kPropagate,
  kFilterDo,
  kFilterGauss,
  kFilterGaussAni,
  kFilterEdge,
  kRandom,
  kRandomWhite,
  kRandomRounded,
  kStackPop,
  kElementGet,
  kElementMatch,
  kPlugin,
  kNumberedOpen,
  kFrameRead,
  // statements
  kFilterCreate,
  kFilterSet,
  kFilterFill,
  kFilterGabor,
  kRandomSeed,
  kStackPush,
  kElementSet,
  kNumberedSave,
  kClipOpen,
  kWebcamOpen,
  kShow,
  kTile,
  kTimer,
  kScalarStatement,  // an instruction with one scalar
  kSetPalette,
  kSetScale,
  kPixelSet,
  kFileSave,
  kSurfaceActuate,
  kNullary,  // an instruction without operands
  kMaskOn,
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
  kElse,
  kEndIf,
  kWhile,
  kEndWhile,
  kFor,
  kEndFor,
  kRepeat,
  kEndRepeat,
  kBreak,
  kContinue,
  kWhere,
  kElsewhere,
  kEndWhere,
};

struct Builtin {
  std::string_view name;
  BuiltinForm form = BuiltinForm::kElementwise;
  std::uint8_t min_arguments = 0, max_arguments = 0;  // arguments, a destination not counted
  program::Opcode op = program::Opcode::kNop;
  std::int8_t dx = 0, dy = 0;  // of one step of a shift: cells east and south

  bool returns_value() const noexcept { return form <= BuiltinForm::kFrameRead; }
};

inline constexpr std::uint8_t kVariadic = 255;

// nullptr for an unknown name.
const Builtin* find_builtin(std::string_view name);
std::vector<std::string> builtin_names();

// The comparison or logical or arithmetic instruction behind an infix operator; kNop if there is none.
program::Opcode infix_opcode(std::string_view op);

}  // namespace apron::compiler
