#include "apron/compiler/Builtins.h"

#include <algorithm>
#include <iterator>
#include <utility>

namespace apron::compiler {
namespace {

using Op = program::Opcode;

constexpr Builtin kBuiltins[] = {
    {"load", BuiltinForm::kElementwise, 1, 1, Op::kCopy},
    {"copy", BuiltinForm::kElementwise, 1, 1, Op::kCopy},
    {"add", BuiltinForm::kElementwise, 2, 2, Op::kAdd},
    {"sub", BuiltinForm::kElementwise, 2, 2, Op::kSub},
    {"mul", BuiltinForm::kElementwise, 2, 2, Op::kMul},
    {"div", BuiltinForm::kElementwise, 2, 2, Op::kDiv},
    {"mod", BuiltinForm::kElementwise, 2, 2, Op::kMod},
    {"min", BuiltinForm::kElementwise, 2, 2, Op::kMin},
    {"max", BuiltinForm::kElementwise, 2, 2, Op::kMax},
    {"pow", BuiltinForm::kElementwise, 2, 2, Op::kPow},
    {"abs", BuiltinForm::kElementwise, 1, 1, Op::kAbs},
    {"neg", BuiltinForm::kElementwise, 1, 1, Op::kNeg},
    {"sign", BuiltinForm::kElementwise, 1, 1, Op::kSign},
    {"clamp", BuiltinForm::kElementwise, 3, 3, Op::kClamp},
    {"mac", BuiltinForm::kMac, 3, 3, Op::kMac},
    {"select", BuiltinForm::kElementwise, 3, 3, Op::kSelect},
    {"lt", BuiltinForm::kElementwise, 2, 2, Op::kLt},
    {"le", BuiltinForm::kElementwise, 2, 2, Op::kLe},
    {"gt", BuiltinForm::kElementwise, 2, 2, Op::kGt},
    {"ge", BuiltinForm::kElementwise, 2, 2, Op::kGe},
    {"eq", BuiltinForm::kElementwise, 2, 2, Op::kEq},
    {"ne", BuiltinForm::kElementwise, 2, 2, Op::kNe},
    {"and", BuiltinForm::kElementwise, 2, 2, Op::kAnd},
    {"or", BuiltinForm::kElementwise, 2, 2, Op::kOr},
    {"xor", BuiltinForm::kElementwise, 2, 2, Op::kXor},
    {"nand", BuiltinForm::kElementwise, 2, 2, Op::kNand},
    {"nor", BuiltinForm::kElementwise, 2, 2, Op::kNor},
    {"not", BuiltinForm::kElementwise, 1, 1, Op::kNot},
    {"math.sin", BuiltinForm::kElementwise, 1, 1, Op::kSin},
    {"math.cos", BuiltinForm::kElementwise, 1, 1, Op::kCos},
    {"math.tan", BuiltinForm::kElementwise, 1, 1, Op::kTan},
    {"math.sinh", BuiltinForm::kElementwise, 1, 1, Op::kSinh},
    {"math.cosh", BuiltinForm::kElementwise, 1, 1, Op::kCosh},
    {"math.tanh", BuiltinForm::kElementwise, 1, 1, Op::kTanh},
    {"math.asin", BuiltinForm::kElementwise, 1, 1, Op::kAsin},
    {"math.acos", BuiltinForm::kElementwise, 1, 1, Op::kAcos},
    {"math.atan", BuiltinForm::kElementwise, 1, 1, Op::kAtan},
    {"math.atan2", BuiltinForm::kElementwise, 2, 2, Op::kAtan2},
    {"math.ln", BuiltinForm::kElementwise, 1, 1, Op::kLn},
    {"math.log", BuiltinForm::kElementwise, 1, 1, Op::kLog},
    {"math.exp", BuiltinForm::kElementwise, 1, 1, Op::kExp},
    {"math.sqrt", BuiltinForm::kElementwise, 1, 1, Op::kSqrt},
    {"math.floor", BuiltinForm::kElementwise, 1, 1, Op::kFloor},
    {"math.ceil", BuiltinForm::kElementwise, 1, 1, Op::kCeil},
    {"math.round", BuiltinForm::kElementwise, 1, 1, Op::kRound},
    {"mask.and", BuiltinForm::kElementwise, 2, 2, Op::kAnd},
    {"mask.or", BuiltinForm::kElementwise, 2, 2, Op::kOr},
    {"mask.not", BuiltinForm::kElementwise, 1, 1, Op::kNot},
    {"mask.if", BuiltinForm::kMaskIf, 1, 3, Op::kNop},
    {"shift.north", BuiltinForm::kShift, 1, 2, Op::kShift, 0, -1},
    {"shift.east", BuiltinForm::kShift, 1, 2, Op::kShift, 1, 0},
    {"shift.south", BuiltinForm::kShift, 1, 2, Op::kShift, 0, 1},
    {"shift.west", BuiltinForm::kShift, 1, 2, Op::kShift, -1, 0},
    {"rotate.north", BuiltinForm::kShift, 1, 2, Op::kRotate, 0, -1},
    {"rotate.east", BuiltinForm::kShift, 1, 2, Op::kRotate, 1, 0},
    {"rotate.south", BuiltinForm::kShift, 1, 2, Op::kRotate, 0, 1},
    {"rotate.west", BuiltinForm::kShift, 1, 2, Op::kRotate, -1, 0},
    {"north", BuiltinForm::kShift, 1, 1, Op::kShift, 0, 1},
    {"east", BuiltinForm::kShift, 1, 1, Op::kShift, -1, 0},
    {"south", BuiltinForm::kShift, 1, 1, Op::kShift, 0, -1},
    {"west", BuiltinForm::kShift, 1, 1, Op::kShift, 1, 0},
    {"shift", BuiltinForm::kShiftBy, 3, 3, Op::kShift},
    {"rotate", BuiltinForm::kShiftBy, 3, 3, Op::kRotate},
    {"near.sum", BuiltinForm::kNeighbourhood, 1, 2, Op::kNearSum},
    {"near.min", BuiltinForm::kNeighbourhood, 1, 2, Op::kNearMin},
    {"near.max", BuiltinForm::kNeighbourhood, 1, 2, Op::kNearMax},
    {"near.any", BuiltinForm::kNeighbourhood, 1, 2, Op::kNearAny},
    {"near.all", BuiltinForm::kNeighbourhood, 1, 2, Op::kNearAll},
    {"flood", BuiltinForm::kPropagate, 2, 2, Op::kFlood},
    {"distance", BuiltinForm::kPropagate, 1, 1, Op::kDistance},
    {"spread.max", BuiltinForm::kPropagate, 2, 2, Op::kSpreadMax},
    {"filter.create", BuiltinForm::kFilterCreate, 3, 3},
    {"filter.setElement", BuiltinForm::kFilterSet, 4, 4, Op::kFilterSet},
    {"filter.fill3x3", BuiltinForm::kFilterFill, 10, 10},
    {"filter.fill5x5", BuiltinForm::kFilterFill, 26, 26},
    {"filter.do", BuiltinForm::kFilterDo, 2, 2, Op::kFilterDo},
    {"filter.gauss.fast", BuiltinForm::kFilterGauss, 2, 2},
    {"filter.gauss.ani", BuiltinForm::kFilterGaussAni, 4, 4},
    {"filter.kernel.gabor", BuiltinForm::kFilterGabor, 4, 6},
    {"filter.stock3x3.edge", BuiltinForm::kFilterEdge, 1, 1},
    {"random.float.rand", BuiltinForm::kRandom, 2, 2, Op::kRandomFloat},
    {"random.float.gauss", BuiltinForm::kRandom, 2, 2, Op::kRandomGauss},
    {"random.float.white", BuiltinForm::kRandomWhite, 0, 0, Op::kRandomFloat},
    {"random.int.rand", BuiltinForm::kRandom, 2, 2, Op::kRandomInt},
    {"random.int.gauss", BuiltinForm::kRandomRounded, 2, 2, Op::kRandomGauss},
    {"random.int.white", BuiltinForm::kRandomWhite, 0, 0, Op::kRandomInt},
    {"random.seed", BuiltinForm::kRandomSeed, 1, 1, Op::kRandomSeed},
    {"stack.push_reg", BuiltinForm::kStackPush, 1, 1, Op::kStackPush},
    {"stack.pop_reg", BuiltinForm::kStackPop, 0, 0, Op::kStackPop},
    {"stack.clear", BuiltinForm::kNullary, 0, 0, Op::kStackClear},
    {"res.getvar", BuiltinForm::kElementGet, 2, 2, Op::kResGetVar},
    {"res.setvar", BuiltinForm::kElementSet, 3, 3, Op::kResSetVar},
    {"res.getreg", BuiltinForm::kElementGet, 2, 2, Op::kResGetReg},
    {"res.setreg", BuiltinForm::kElementSet, 3, 3, Op::kResSetReg},
    {"res.match", BuiltinForm::kElementMatch, 2, 2},
    {"plugin", BuiltinForm::kPlugin, 2, 2 + program::kMaxPluginArguments, Op::kPlugin},
    {"globalsum", BuiltinForm::kReduction, 1, 1, Op::kGlobalSum},
    {"globalmean", BuiltinForm::kReduction, 1, 1, Op::kGlobalMean},
    {"globalmin", BuiltinForm::kReduction, 1, 1, Op::kGlobalMin},
    {"globalmax", BuiltinForm::kReduction, 1, 1, Op::kGlobalMax},
    {"globalcount", BuiltinForm::kReduction, 1, 1, Op::kGlobalCount},
    {"globalany", BuiltinForm::kReduction, 1, 1, Op::kGlobalAny},
    {"pixel.get", BuiltinForm::kPixelGet, 3, 3, Op::kPixelGet},
    {"pixel.set", BuiltinForm::kPixelSet, 4, 4, Op::kPixelSet},
    {"cell.x", BuiltinForm::kCellCoordinate, 0, 0, Op::kCellX},
    {"cell.col", BuiltinForm::kCellCoordinate, 0, 0, Op::kCellX},
    {"cell.y", BuiltinForm::kCellCoordinate, 0, 0, Op::kCellY},
    {"cell.row", BuiltinForm::kCellCoordinate, 0, 0, Op::kCellY},
    {"reg.getWidth", BuiltinForm::kRegisterWidth, 1, 1},
    {"reg.getHeight", BuiltinForm::kRegisterHeight, 1, 1},
    {"reg.getID", BuiltinForm::kRegisterId, 1, 1},
    {"reg.setPalette", BuiltinForm::kSetPalette, 2, 3, Op::kSetPalette},
    {"reg.setScale", BuiltinForm::kSetScale, 2, 3, Op::kSetScale},
    {"mask.on", BuiltinForm::kMaskOn, 1, 1, Op::kMaskOn},
    {"mask.off", BuiltinForm::kNullary, 0, 0, Op::kMaskOff},
    {"boundary", BuiltinForm::kBoundary, 1, 1, Op::kBoundary},
    {"surface.time", BuiltinForm::kSurfaceScalar, 0, 0, Op::kSurfaceTime},
    {"surface.dt", BuiltinForm::kSurfaceScalar, 0, 0, Op::kSurfaceDt},
    {"surface.tick", BuiltinForm::kSurfaceScalar, 0, 0, Op::kSurfaceTick},
    {"surface.has", BuiltinForm::kSurfaceHas, 1, 1, Op::kSurfaceHas},
    {"surface.sense", BuiltinForm::kSurfaceSense, 1, 1, Op::kSurfaceSense},
    {"surface.actuate", BuiltinForm::kSurfaceActuate, 2, 2, Op::kSurfaceActuate},
    {"surface.step", BuiltinForm::kNullary, 0, 0, Op::kSurfaceStep},
    {"sim.frame", BuiltinForm::kNullary, 0, 0, Op::kSurfaceStep},
    {"surface.free_run", BuiltinForm::kScalarStatement, 1, 1, Op::kSurfaceFreeRun},
    {"io.key", BuiltinForm::kKey, 0, 1, Op::kKeyDown},
    {"io.array.open", BuiltinForm::kFileOpen, 1, 1, Op::kArrayOpen},
    {"io.array.save", BuiltinForm::kFileSave, 2, 2, Op::kArraySave},
    {"io.image.open", BuiltinForm::kFileOpen, 1, 1, Op::kImageOpen},
    {"io.image.save", BuiltinForm::kFileSave, 2, 2, Op::kImageSave},
    {"io.image.opencount", BuiltinForm::kNumberedOpen, 2, 2, Op::kImageOpenCount},
    {"io.image.savecount", BuiltinForm::kNumberedSave, 3, 3, Op::kImageSaveCount},
    {"video.clip.open", BuiltinForm::kClipOpen, 1, 1, Op::kClipOpen},
    {"video.clip.read", BuiltinForm::kFrameRead, 0, 0, Op::kClipRead},
    {"video.clip.close", BuiltinForm::kNullary, 0, 0, Op::kClipClose},
    {"webcam.open", BuiltinForm::kWebcamOpen, 0, 1, Op::kWebcamOpen},
    {"webcam.read", BuiltinForm::kFrameRead, 0, 0, Op::kWebcamRead},
    {"webcam.close", BuiltinForm::kNullary, 0, 0, Op::kWebcamClose},
    {"print", BuiltinForm::kPrint, 0, kVariadic},
    {"println", BuiltinForm::kPrint, 0, kVariadic, Op::kPrintLine},
    {"sim.show", BuiltinForm::kShow, 1, 2, Op::kShow},
    {"sim.display", BuiltinForm::kShow, 1, 2, Op::kDisplay},
    {"sim.tile", BuiltinForm::kTile, 0, 2, Op::kTile},
    {"sim.label", BuiltinForm::kLabel, 0, kVariadic},
    {"sim.slider.add", BuiltinForm::kSliderAdd, 3, 4},
    {"sim.slider.get", BuiltinForm::kParameterGet, 1, 1, Op::kParameter},
    {"sim.switch.add", BuiltinForm::kSwitchAdd, 1, 2},
    {"sim.switch.get", BuiltinForm::kParameterGet, 1, 1, Op::kParameter},
    {"timer.start", BuiltinForm::kTimer, 0, 1, Op::kTimerStart},
    {"timer.stop", BuiltinForm::kTimer, 0, 1, Op::kTimerStop},
    {"timer.reset", BuiltinForm::kTimer, 0, 1, Op::kTimerReset},
    {"timer.read", BuiltinForm::kTimerRead, 0, 1, Op::kTimerRead},
    {"timer.wait", BuiltinForm::kScalarStatement, 1, 1, Op::kTimerWait},
    {"nop", BuiltinForm::kNullary, 0, 0, Op::kNop},
    {"end", BuiltinForm::kNullary, 0, 0, Op::kEnd},
    {"return", BuiltinForm::kReturn, 0, 0, Op::kReturn},
    {"jump", BuiltinForm::kJump, 1, 1, Op::kJump},
    {"jumpif", BuiltinForm::kJumpIf, 2, 4},
    {"call", BuiltinForm::kCall, 1, 1, Op::kCall},
    {"callif", BuiltinForm::kCallIf, 2, 4},
    {"if", BuiltinForm::kIf, 1, 3},
    {"else", BuiltinForm::kElse, 0, 0},
    {"endif", BuiltinForm::kEndIf, 0, 0},
    {"while", BuiltinForm::kWhile, 1, 3},
    {"endwhile", BuiltinForm::kEndWhile, 0, 0},
    {"for", BuiltinForm::kFor, 3, 4},
    {"endfor", BuiltinForm::kEndFor, 0, 0},
    {"repeat", BuiltinForm::kRepeat, 1, 1},
    {"endrepeat", BuiltinForm::kEndRepeat, 0, 0},
    {"break", BuiltinForm::kBreak, 0, 0},
    {"continue", BuiltinForm::kContinue, 0, 0},
    {"where", BuiltinForm::kWhere, 1, 3},
    {"elsewhere", BuiltinForm::kElsewhere, 0, 0},
    {"endwhere", BuiltinForm::kEndWhere, 0, 0},
};

bool starts_with(std::string_view text, std::string_view prefix) {
  return text.substr(0, prefix.size()) == prefix;
}

// The prefixed forms of arithmetic, comparison and logic, such as core.add for add.
bool has_core_alias(const Builtin& builtin) {
  const bool plain = builtin.name.find('.') == std::string_view::npos;
  return plain && (builtin.form == BuiltinForm::kElementwise || builtin.form == BuiltinForm::kMac);
}

const Builtin* find_exact(std::string_view name) {
  const auto* const found = std::find_if(std::begin(kBuiltins), std::end(kBuiltins),
                                         [&](const Builtin& b) { return b.name == name; });
  return found == std::end(kBuiltins) ? nullptr : found;
}

}  // namespace

const Builtin* find_builtin(std::string_view name) {
  constexpr std::string_view kCore = "core.";
  if (!starts_with(name, kCore)) return find_exact(name);
  const Builtin* builtin = find_exact(name.substr(kCore.size()));
  return builtin != nullptr && has_core_alias(*builtin) ? builtin : nullptr;
}

std::vector<std::string> builtin_names() {
  std::vector<std::string> names;
  for (const Builtin& builtin : kBuiltins) names.emplace_back(builtin.name);
  return names;
}

program::Opcode infix_opcode(std::string_view op) {
  static constexpr std::pair<std::string_view, Op> kInfix[] = {
      {"+", Op::kAdd},   {"-", Op::kSub},     {"*", Op::kMul},  {"/", Op::kDiv}, {"%", Op::kMod},
      {"<", Op::kLt},    {"<=", Op::kLe},     {">", Op::kGt},   {">=", Op::kGe}, {"==", Op::kEq},
      {"!=", Op::kNe},   {"and", Op::kAnd},   {"&&", Op::kAnd}, {"or", Op::kOr}, {"||", Op::kOr},
      {"xor", Op::kXor}, {"nand", Op::kNand}, {"nor", Op::kNor}};
  for (const auto& [text, opcode] : kInfix) {
    if (text == op) return opcode;
  }
  return Op::kNop;
}

}  // namespace apron::compiler
