#include "apron/compiler/Builtins.h"

#include <algorithm>
#include <deque>
#include <iterator>
#include <utility>

namespace apron::compiler {
namespace {

using Form = BuiltinForm;
using Op = program::Opcode;

constexpr Builtin kBuiltins[] = {
    {"load", Form::kElementwise, 1, 1, Op::kCopy},
    {"float", Form::kConvert, 1, 1, Op::kConvert, 0, 0, program::CellType::kFloat32},
    {"int32", Form::kConvert, 1, 1, Op::kConvert, 0, 0, program::CellType::kInt32},
    {"uint16", Form::kConvert, 1, 1, Op::kConvert, 0, 0, program::CellType::kUint16},
    {"uint8", Form::kConvert, 1, 1, Op::kConvert, 0, 0, program::CellType::kUint8},
    {"sat.int32", Form::kConvert, 1, 1, Op::kConvertSaturated, 0, 0, program::CellType::kInt32},
    {"sat.uint16", Form::kConvert, 1, 1, Op::kConvertSaturated, 0, 0, program::CellType::kUint16},
    {"sat.uint8", Form::kConvert, 1, 1, Op::kConvertSaturated, 0, 0, program::CellType::kUint8},
    {"sat.add", Form::kElementwise, 2, 2, Op::kAddSaturated},
    {"sat.sub", Form::kElementwise, 2, 2, Op::kSubSaturated},
    {"mask.and", Form::kElementwise, 2, 2, Op::kAnd},
    {"mask.or", Form::kElementwise, 2, 2, Op::kOr},
    {"mask.not", Form::kElementwise, 1, 1, Op::kNot},
    {"mask.if", Form::kMaskIf, 1, 3, Op::kNop},
    {"shift.north", Form::kShift, 1, 2, Op::kShift, 0, -1},
    {"shift.east", Form::kShift, 1, 2, Op::kShift, 1, 0},
    {"shift.south", Form::kShift, 1, 2, Op::kShift, 0, 1},
    {"shift.west", Form::kShift, 1, 2, Op::kShift, -1, 0},
    {"rotate.north", Form::kShift, 1, 2, Op::kRotate, 0, -1},
    {"rotate.east", Form::kShift, 1, 2, Op::kRotate, 1, 0},
    {"rotate.south", Form::kShift, 1, 2, Op::kRotate, 0, 1},
    {"rotate.west", Form::kShift, 1, 2, Op::kRotate, -1, 0},
    {"north", Form::kShift, 1, 1, Op::kShift, 0, 1},
    {"east", Form::kShift, 1, 1, Op::kShift, -1, 0},
    {"south", Form::kShift, 1, 1, Op::kShift, 0, -1},
    {"west", Form::kShift, 1, 1, Op::kShift, 1, 0},
    {"shift", Form::kShiftBy, 3, 3, Op::kShift},
    {"rotate", Form::kShiftBy, 3, 3, Op::kRotate},
    {"near.sum", Form::kNeighbourhood, 1, 2, Op::kNearSum},
    {"near.min", Form::kNeighbourhood, 1, 2, Op::kNearMin},
    {"near.max", Form::kNeighbourhood, 1, 2, Op::kNearMax},
    {"near.any", Form::kNeighbourhood, 1, 2, Op::kNearAny},
    {"near.all", Form::kNeighbourhood, 1, 2, Op::kNearAll},
    {"flood", Form::kPropagate, 2, 2, Op::kFlood},
    {"distance", Form::kPropagate, 1, 1, Op::kDistance},
    {"spread.max", Form::kPropagate, 2, 2, Op::kSpreadMax},
    {"spread.sum", Form::kPropagate, 2, 2, Op::kSpreadSum},
    {"spread.number", Form::kPropagate, 1, 1, Op::kSpreadNumber},
    {"scatter.sum", Form::kScatter, 2, 2, Op::kScatter},
    {"histogram", Form::kScatter, 1, 1, Op::kScatter},
    {"matrix.product", Form::kMatrixProduct, 3, 3, Op::kMatrixProduct},
    {"filter.create", Form::kFilterCreate, 3, 3},
    {"filter.setElement", Form::kFilterSet, 4, 4, Op::kFilterSet},
    {"filter.fill3x3", Form::kFilterFill, 10, 10},
    {"filter.fill5x5", Form::kFilterFill, 26, 26},
    {"filter.do", Form::kFilterDo, 2, 2, Op::kFilterDo},
    {"filter.gauss.fast", Form::kFilterGauss, 2, 2},
    {"filter.gauss.ani", Form::kFilterGaussAni, 4, 4},
    {"filter.kernel.gabor", Form::kFilterGabor, 4, 6},
    {"filter.stock3x3.edge", Form::kFilterEdge, 1, 1},
    {"random.float.rand", Form::kRandom, 2, 2, Op::kRandomFloat},
    {"random.float.gauss", Form::kRandom, 2, 2, Op::kRandomGauss},
    {"random.float.white", Form::kRandomWhite, 0, 0, Op::kRandomFloat},
    {"random.int.rand", Form::kRandom, 2, 2, Op::kRandomInt},
    {"random.int.gauss", Form::kRandomRounded, 2, 2, Op::kRandomGauss},
    {"random.int.white", Form::kRandomWhite, 0, 0, Op::kRandomInt},
    {"random.seed", Form::kOperands, 1, 1, Op::kRandomSeed},
    {"stack.push_reg", Form::kOperands, 1, 1, Op::kStackPush},
    {"stack.pop_reg", Form::kOperands, 0, 0, Op::kStackPop},
    {"stack.clear", Form::kOperands, 0, 0, Op::kStackClear},
    {"res.getvar", Form::kOperands, 2, 2, Op::kResGetVar},
    {"res.setvar", Form::kOperands, 3, 3, Op::kResSetVar},
    {"res.getreg", Form::kOperands, 2, 2, Op::kResGetReg},
    {"res.setreg", Form::kOperands, 3, 3, Op::kResSetReg},
    {"res.match", Form::kElementMatch, 2, 2},
    {"plugin", Form::kPlugin, 2, 2 + program::kMaxPluginArguments, Op::kPlugin},
    {"globalsum", Form::kOperands, 1, 1, Op::kGlobalSum},
    {"globalmean", Form::kOperands, 1, 1, Op::kGlobalMean},
    {"globalmin", Form::kOperands, 1, 1, Op::kGlobalMin},
    {"globalmax", Form::kOperands, 1, 1, Op::kGlobalMax},
    {"globalcount", Form::kOperands, 1, 1, Op::kGlobalCount},
    {"globalany", Form::kOperands, 1, 1, Op::kGlobalAny},
    {"pixel.get", Form::kOperands, 3, 3, Op::kPixelGet},
    {"pixel.set", Form::kPixelSet, 4, 4, Op::kPixelSet},
    {"cell.x", Form::kOperands, 0, 0, Op::kCellX},
    {"cell.col", Form::kOperands, 0, 0, Op::kCellX},
    {"cell.y", Form::kOperands, 0, 0, Op::kCellY},
    {"cell.row", Form::kOperands, 0, 0, Op::kCellY},
    {"reg.getWidth", Form::kRegisterWidth, 1, 1},
    {"reg.getHeight", Form::kRegisterHeight, 1, 1},
    {"reg.getID", Form::kRegisterId, 1, 1},
    {"reg.setPalette", Form::kColourMapping, 2, 3, Op::kSetPalette},
    {"reg.setScale", Form::kColourMapping, 2, 3, Op::kSetScale},
    {"mask.on", Form::kOperands, 1, 1, Op::kMaskOn},
    {"mask.off", Form::kOperands, 0, 0, Op::kMaskOff},
    {"boundary", Form::kBoundary, 1, 1, Op::kBoundary},
    {"surface.time", Form::kOperands, 0, 0, Op::kSurfaceTime},
    {"surface.dt", Form::kOperands, 0, 0, Op::kSurfaceDt},
    {"surface.tick", Form::kOperands, 0, 0, Op::kSurfaceTick},
    {"surface.has", Form::kOperands, 1, 1, Op::kSurfaceHas, 0, 0, {}, "a channel's name"},
    {"surface.sense", Form::kOperands, 1, 1, Op::kSurfaceSense, 0, 0, {}, "a channel's name"},
    {"surface.actuate", Form::kSurfaceActuate, 2, 2, Op::kSurfaceActuate, 0, 0, {}, "a channel's name"},
    {"surface.step", Form::kOperands, 0, 0, Op::kSurfaceStep},
    {"sim.frame", Form::kOperands, 0, 0, Op::kSurfaceStep},
    {"surface.free_run", Form::kOperands, 1, 1, Op::kSurfaceFreeRun},
    {"io.key", Form::kKey, 0, 1, Op::kKeyDown},
    {"io.array.open", Form::kOperands, 1, 1, Op::kArrayOpen, 0, 0, {}, "a file name"},
    {"io.array.save", Form::kOperands, 2, 2, Op::kArraySave, 0, 0, {}, "a file name"},
    {"io.image.open", Form::kOperands, 1, 1, Op::kImageOpen, 0, 0, {}, "a file name"},
    {"io.image.save", Form::kOperands, 2, 2, Op::kImageSave, 0, 0, {}, "a file name"},
    {"io.image.opencount", Form::kOperands, 2, 2, Op::kImageOpenCount, 0, 0, {}, "a file name"},
    {"io.image.savecount", Form::kOperands, 3, 3, Op::kImageSaveCount, 0, 0, {}, "a file name"},
    {"video.clip.open", Form::kOperands, 1, 1, Op::kClipOpen, 0, 0, {}, "a file name"},
    {"video.clip.read", Form::kOperands, 0, 0, Op::kClipRead},
    {"video.clip.close", Form::kOperands, 0, 0, Op::kClipClose},
    {"webcam.open", Form::kOperands, 0, 1, Op::kWebcamOpen},
    {"webcam.read", Form::kOperands, 0, 0, Op::kWebcamRead},
    {"webcam.close", Form::kOperands, 0, 0, Op::kWebcamClose},
    {"print", Form::kPrint, 0, kVariadic},
    {"println", Form::kPrint, 0, kVariadic, Op::kPrintLine},
    {"sim.show", Form::kOperands, 1, 2, Op::kShow, 0, 0, {}, "a title"},
    {"sim.display", Form::kOperands, 1, 2, Op::kDisplay, 0, 0, {}, "a title"},
    {"sim.tile", Form::kTile, 0, 2, Op::kTile},
    {"sim.label", Form::kLabel, 0, kVariadic},
    {"sim.slider.add", Form::kSliderAdd, 3, 4},
    {"sim.slider.get", Form::kParameterGet, 1, 1, Op::kParameter},
    {"sim.switch.add", Form::kSwitchAdd, 1, 2},
    {"sim.switch.get", Form::kParameterGet, 1, 1, Op::kParameter},
    {"timer.start", Form::kOperands, 0, 1, Op::kTimerStart, 0, 0, {}, "a timer's name"},
    {"timer.stop", Form::kOperands, 0, 1, Op::kTimerStop, 0, 0, {}, "a timer's name"},
    {"timer.reset", Form::kOperands, 0, 1, Op::kTimerReset, 0, 0, {}, "a timer's name"},
    {"timer.read", Form::kOperands, 0, 1, Op::kTimerRead, 0, 0, {}, "a timer's name"},
    {"timer.wait", Form::kOperands, 1, 1, Op::kTimerWait},
    {"nop", Form::kOperands, 0, 0, Op::kNop},
    {"end", Form::kOperands, 0, 0, Op::kEnd},
    {"return", Form::kReturn, 0, 0, Op::kReturn},
    {"jump", Form::kJump, 1, 1, Op::kJump},
    {"jumpif", Form::kJumpIf, 2, 4},
    {"call", Form::kCall, 1, 1, Op::kCall},
    {"callif", Form::kCallIf, 2, 4},
    {"if", Form::kIf, 1, 3},
    {"else", Form::kElse, 0, 0},
    {"endif", Form::kEndIf, 0, 0},
    {"while", Form::kWhile, 1, 3},
    {"endwhile", Form::kEndWhile, 0, 0},
    {"for", Form::kFor, 3, 4},
    {"endfor", Form::kEndFor, 0, 0},
    {"repeat", Form::kRepeat, 1, 1},
    {"endrepeat", Form::kEndRepeat, 0, 0},
    {"break", Form::kBreak, 0, 0},
    {"continue", Form::kContinue, 0, 0},
    {"where", Form::kWhere, 1, 3},
    {"elsewhere", Form::kElsewhere, 0, 0},
    {"endwhere", Form::kEndWhere, 0, 0},
};

// The element-wise instructions under their mnemonics, those of the section `maths` of opcodes.def and atan2
// with the prefix "math."; then the others.
std::vector<Builtin> make_builtins() {
  static constexpr Builtin kInstructions[] = {
#define APRON_ELEMENTWISE(name, arity, value) {{}, Form::kElementwise, arity, arity, Op::k##name},
#define APRON_INTEGER APRON_ELEMENTWISE
#define APRON_MATHEMATICS(name, arity, value) {{}, Form::kElementwise, arity, arity, Op::k##name},
#include "apron/program/elementwise.def"
  };
  static std::deque<std::string> names;
  std::vector<Builtin> all;
  for (Builtin builtin : kInstructions) {
    if (builtin.op == Op::kMac) builtin.form = Form::kMac;
    const bool is_maths = builtin.op >= Op::kSin || (builtin.op == Op::kAtan2);
    names.push_back((is_maths ? "math." : "") + std::string(program::opcode_info(builtin.op).mnemonic));
    builtin.name = names.back();
    all.push_back(builtin);
  }
  all.insert(all.end(), std::begin(kBuiltins), std::end(kBuiltins));
  return all;
}

const std::vector<Builtin>& builtins() {
  static const std::vector<Builtin> all = make_builtins();
  return all;
}

// The prefixed forms of arithmetic, comparison and logic, such as core.add for add.
bool has_core_alias(const Builtin& builtin) {
  const bool plain = builtin.name.find('.') == std::string_view::npos;
  return plain && (builtin.form == Form::kElementwise || builtin.form == Form::kMac);
}

const Builtin* find_exact(std::string_view name) {
  const auto found = std::ranges::find(builtins(), name, &Builtin::name);
  return found == builtins().end() ? nullptr : &*found;
}

}  // namespace

const Builtin* find_builtin(std::string_view name) {
  constexpr std::string_view kCore = "core.";
  if (!name.starts_with(kCore)) return find_exact(name);
  const Builtin* builtin = find_exact(name.substr(kCore.size()));
  return builtin != nullptr && has_core_alias(*builtin) ? builtin : nullptr;
}

std::vector<std::string> builtin_names() {
  std::vector<std::string> names;
  for (const Builtin& builtin : builtins()) names.emplace_back(builtin.name);
  return names;
}

program::Opcode infix_opcode(std::string_view op) {
  static constexpr std::pair<std::string_view, Op> kInfix[] = {
      {"+", Op::kAdd},    {"-", Op::kSub},      {"*", Op::kMul},      {"/", Op::kDiv},    {"%", Op::kMod},
      {"<", Op::kLt},     {"<=", Op::kLe},      {">", Op::kGt},       {">=", Op::kGe},    {"==", Op::kEq},
      {"!=", Op::kNe},    {"and", Op::kAnd},    {"&&", Op::kAnd},     {"or", Op::kOr},    {"||", Op::kOr},
      {"xor", Op::kXor},  {"nand", Op::kNand},  {"nor", Op::kNor},    {"&", Op::kBitAnd}, {"|", Op::kBitOr},
      {"^", Op::kBitXor}, {"<<", Op::kBitLeft}, {">>", Op::kBitRight}};
  for (const auto& [text, opcode] : kInfix) {
    if (text == op) return opcode;
  }
  return Op::kNop;
}

}  // namespace apron::compiler
