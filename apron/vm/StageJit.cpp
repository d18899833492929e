// A stage as one loop over vectors of 16 cells, with everything between its loads and its stores in
// registers.
#include "apron/vm/PlaneStore.h"
#include "apron/vm/StageCode.h"

#if defined(__x86_64__) && defined(APRON_HAVE_XBYAK)

#include <xbyak/xbyak.h>
#include <xbyak/xbyak_util.h>

#include <algorithm>
#include <cstddef>
#include <cstring>
#include <map>
#include <optional>

namespace apron::vm {
namespace {

using program::Opcode;
using Xbyak::Address;
using Xbyak::Opmask;
using Xbyak::Reg64;
using Xbyak::Zmm;

constexpr std::size_t kFirstCode = 4096;
constexpr int kVectors = 32;
constexpr int kMasks = 8;               // k0 cannot be a predicate
constexpr std::size_t kMaxRolling = 4;  // streams whose neighbouring vectors are kept
constexpr int kMaxFixed = 10;           // vectors that hold scalars and constants throughout
constexpr int kVectorBytes = 64;
constexpr std::uint32_t kMaxUnroll = 8;

// Predicates of vcmpps. A NaN is true: NEQ_UQ.
enum Compare : std::uint8_t {
  kEqual = 0,
  kNotEqual = 4,
  kLess = 17,
  kLessEqual = 18,
  kGreater = 30,
  kGreaterEqual = 29
};

// Thrown inside the compiler only: the stage needs more registers than there are.
struct DoesNotFit {};

class Compiler final : public StageJit, private Xbyak::CodeGenerator {
 public:
  Compiler(const Stage& stage, std::uint32_t vectors)
      : CodeGenerator(kFirstCode, Xbyak::AutoGrow), stage_(stage), unroll_(unroll(vectors)) {
    temps_.resize(stage_.ops.size());
    count_uses();
    choose_fixed();
    choose_rolling();
    prologue();
    body();
    epilogue();
    readyRE();
    code_ = getCode<void (*)(const StageCall*)>();
  }

 private:
  // What a vector register holds, or where a value is.
  struct Value {
    int vector = -1;
    int mask = -1;
    std::size_t uses = 0;  // to come
  };
  struct Rolling {
    int west = -1, own = -1, east = -1;
  };
  using StreamKey = std::pair<std::uint32_t, int>;  // stream, dx

  const Reg64 kCall = rdi, kSlots = rsi, kRowBytes = rdx, kColumn = rcx, kRows = r15;
  const std::array<Reg64, kMaxStreams> kPointers{rax, rbx, rbp, r8, r9, r10, r11, r12, r13, r14};

  void count_uses() {
    for (const MicroOp& op : stage_.ops)
      for (const MicroArg& arg : op.args) {
        if (arg.kind == MicroArg::Kind::kTemp) ++temps_[arg.index].uses;
        if (arg.kind == MicroArg::Kind::kStream) ++loads_[{arg.index, arg.dx}].uses;
        if (arg.kind == MicroArg::Kind::kScalar) ++scalars_[arg.index].uses;
      }
    for (const Stage::Result& result : stage_.results) ++temps_[result.op].uses;
  }

  // The highest vectors keep the constants, then the scalars as far as they go.
  void choose_fixed() {
    int next = kVectors - 1;
    const auto take = [&](Value& value) {
      if (next > kVectors - 1 - kMaxFixed) value.vector = next--;
    };
    take(bits(0));
    take(bits(0x3F800000U));
    for (const MicroOp& op : stage_.ops) {
      if (op.op == Opcode::kAbs) take_once(bits(0x7FFFFFFFU), take);
      if (op.op == Opcode::kNeg) take_once(bits(0x80000000U), take);
    }
    for (auto& [slot, value] : scalars_) take(value);
    free_.clear();
    for (int v = 0; v <= next; ++v) free_.push_back(v);
    for (int k = 1; k < kMasks; ++k) free_masks_.push_back(k);
  }

  // A row that is read to the west or east too passes through three vectors, one load for each of its own: a
  // load that straddles two cache lines costs two.
  void choose_rolling() {
    for (const auto& [key, load] : loads_) {
      if (key.second == 0 || rolling_.count(key.first) > 0 || rolling_.size() == kMaxRolling) continue;
      Rolling& r = rolling_[key.first];
      for (int* v : {&r.west, &r.own, &r.east}) {
        *v = free_.front();
        free_.erase(free_.begin());
      }
    }
  }

  template <class Take>
  static void take_once(Value& value, const Take& take) {
    if (value.vector < 0) take(value);
  }

  Value& bits(std::uint32_t pattern) { return constants_[pattern]; }
  Zmm constant(std::uint32_t pattern) { return Zmm(constants_.at(pattern).vector); }
  Zmm zero() { return constant(0); }
  Zmm one() { return constant(0x3F800000U); }

  void prologue() {
    for (const Reg64& r : {rbx, rbp, r12, r13, r14, r15}) push(r);
    for (const auto& [pattern, value] : constants_) {
      mov(eax, pattern);
      vpbroadcastd(Zmm(value.vector), eax);
    }
    mov(kSlots, ptr[kCall + offsetof(StageCall, slots)]);
    for (const auto& [slot, value] : scalars_)
      if (value.vector >= 0) vbroadcastss(Zmm(value.vector), ptr[kSlots + slot * sizeof(float)]);
    mov(kRows, ptr[kCall + offsetof(StageCall, rows)]);
    mov(kRowBytes, ptr[kCall + offsetof(StageCall, row_bytes)]);
    for (std::size_t s = 0; s < stage_.streams.size(); ++s)
      mov(kPointers[s], ptr[kCall + offsetof(StageCall, first) + s * sizeof(float*)]);
  }

  void body() {
    Xbyak::Label row, column;
    L(row);
    for (const auto& [stream, r] : rolling_) {
      vmovups(Zmm(r.west), ptr[kPointers[stream] - kVectorBytes]);
      vmovups(Zmm(r.own), ptr[kPointers[stream]]);
    }
    xor_(ecx, ecx);
    L(column);
    const std::map<std::uint32_t, Rolling> at_start = rolling_;
    for (std::uint32_t i = 0; i < unroll_; ++i) {
      ahead_ = static_cast<int>(i) * kVectorBytes;
      if (i > 0) count_uses();
      one_vector();
    }
    for (const auto& [stream, r] : at_start) restore(r, rolling_.at(stream));
    rolling_ = at_start;
    add(kColumn, static_cast<int>(unroll_) * kVectorBytes);
    cmp(kColumn, kRowBytes);
    jb(column, T_NEAR);
    for (std::size_t s = 0; s < stage_.streams.size(); ++s)
      add(kPointers[s], ptr[kCall + offsetof(StageCall, pitch_bytes) + s * sizeof(std::ptrdiff_t)]);
    dec(kRows);
    jnz(row, T_NEAR);
  }

  void one_vector() {
    for (const auto& [stream, r] : rolling_)
      vmovups(Zmm(r.east), ptr[kPointers[stream] + kColumn + (ahead_ + kVectorBytes)]);
    for (std::size_t i = 0; i < stage_.ops.size(); ++i) operation(i);
    for (const Stage::Result& result : stage_.results) {
      const Zmm v = vector({MicroArg::Kind::kTemp, 0, result.op});
      vmovups(ptr[kPointers[result.stream] + kColumn + ahead_], v);
      used({MicroArg::Kind::kTemp, 0, result.op});
      pinned_.clear();
    }
    for (auto& [stream, r] : rolling_) r = {r.own, r.east, r.west};
  }

  // West and own of the next vector to where the loop's start has them; `now` has turned some times.
  void restore(const Rolling& start, const Rolling& now) {
    if (now.own == start.own) return;  // whole turns
    if (now.west == start.own) {       // one turn: own is where east was
      vmovaps(Zmm(start.west), Zmm(now.west));
      vmovaps(Zmm(start.own), Zmm(now.own));
    } else {  // two turns: own is where west was
      vmovaps(Zmm(start.own), Zmm(now.own));
      vmovaps(Zmm(start.west), Zmm(now.west));
    }
  }

  // Short rows are one piece of code, longer ones loops over four vectors.
  static std::uint32_t unroll(std::uint32_t vectors) {
    if (vectors <= kMaxUnroll) return std::max(vectors, 1U);
    for (const std::uint32_t n : {4U, 3U, 2U})
      if (vectors % n == 0) return n;
    return 1;
  }

  void epilogue() {
    for (const Reg64& r : {r15, r14, r13, r12, rbp, rbx}) pop(r);
    vzeroupper();
    ret();
  }

  // ---- registers ----
  Zmm new_vector() {
    if (free_.empty()) evict();
    const int v = free_.back();
    free_.pop_back();
    return Zmm(v);
  }

  // What was loaded can be loaded again.
  void evict() {
    for (auto& [key, load] : loads_) {
      if (load.vector < 0 || pinned(load.vector)) continue;
      free_.push_back(load.vector);
      load.vector = -1;
      return;
    }
    throw DoesNotFit{};
  }

  bool pinned(int v) const { return std::find(pinned_.begin(), pinned_.end(), v) != pinned_.end(); }

  int new_mask() {
    if (free_masks_.empty()) {
      const auto holder = std::find_if(temps_.begin(), temps_.end(), [&](const Value& t) {
        return t.mask >= 0 &&
               std::find(pinned_masks_.begin(), pinned_masks_.end(), t.mask) == pinned_masks_.end();
      });
      if (holder == temps_.end()) throw DoesNotFit{};
      if (holder->vector < 0) as_vector(*holder);
      free_masks_.push_back(holder->mask);
      holder->mask = -1;
    }
    const int k = free_masks_.back();
    free_masks_.pop_back();
    return k;
  }

  // A truth value as 0 or 1.
  void as_vector(Value& temp) {
    const Zmm v = new_vector();
    vmovaps(v | Opmask(temp.mask) | T_z, one());
    temp.vector = v.getIdx();
  }

  Address address(const MicroArg& arg) {
    return ptr[kPointers[arg.index] + kColumn + (ahead_ + arg.dx * static_cast<int>(sizeof(float)))];
  }

  int loaded(const MicroArg& arg) {
    Value& load = loads_.at({arg.index, arg.dx});
    const auto rolling = rolling_.find(arg.index);
    if (rolling != rolling_.end() && arg.dx == 0) return rolling->second.own;
    if (load.vector >= 0) return load.vector;
    const Zmm to = new_vector();
    load.vector = to.getIdx();
    if (rolling == rolling_.end()) {
      vmovups(to, address(arg));
    } else {
      const Rolling& r = rolling->second;
      const bool west = arg.dx < 0;
      valignd(to, Zmm(west ? r.own : r.east), Zmm(west ? r.west : r.own), west ? kLanes + arg.dx : arg.dx);
    }
    return load.vector;
  }

  // The operand in a vector register.
  Zmm vector(const MicroArg& arg) {
    int v = -1;
    if (arg.kind == MicroArg::Kind::kTemp) {
      Value& temp = temps_[arg.index];
      if (temp.vector < 0) as_vector(temp);
      v = temp.vector;
    } else if (arg.kind == MicroArg::Kind::kStream) {
      v = loaded(arg);
    } else {
      Value& scalar = scalars_.at(arg.index);
      v = scalar.vector;
      if (v < 0) {
        const Zmm to = new_vector();
        vbroadcastss(to, ptr[kSlots + arg.index * sizeof(float)]);
        v = to.getIdx();
        loose_.push_back(v);
      }
    }
    pinned_.push_back(v);
    return Zmm(v);
  }

  // The operand as a vector, or where it lies if nobody needs it again.
  template <class Emit>
  void with_operand(const MicroArg& arg, const Emit& emit) {
    if (arg.kind == MicroArg::Kind::kStream) {
      const Value& load = loads_.at({arg.index, arg.dx});
      if (load.vector < 0 && load.uses == 1 && rolling_.count(arg.index) == 0) return emit(address(arg));
    }
    if (arg.kind == MicroArg::Kind::kScalar && scalars_.at(arg.index).vector < 0)
      return emit(ptr_b[kSlots + arg.index * sizeof(float)]);
    emit(vector(arg));
  }

  // Where the operand is true.
  int truth(const MicroArg& arg) {
    Value* temp = arg.kind == MicroArg::Kind::kTemp ? &temps_[arg.index] : nullptr;
    int k = temp != nullptr ? temp->mask : -1;
    if (k < 0) {
      k = new_mask();
      pinned_masks_.push_back(k);
      with_operand(arg, [&](const auto& x) { vcmpps(Opmask(k), zero(), x, kNotEqual); });
      if (temp != nullptr)
        temp->mask = k;
      else
        loose_masks_.push_back(k);
    }
    pinned_masks_.push_back(k);
    return k;
  }

  void used(const MicroArg& arg) {
    if (arg.kind == MicroArg::Kind::kTemp) {
      Value& temp = temps_[arg.index];
      if (--temp.uses > 0) return;
      if (temp.vector >= 0) free_.push_back(temp.vector);
      if (temp.mask >= 0) free_masks_.push_back(temp.mask);
      temp.vector = temp.mask = -1;
    } else if (arg.kind == MicroArg::Kind::kStream) {
      Value& load = loads_.at({arg.index, arg.dx});
      if (--load.uses > 0 || load.vector < 0) return;
      free_.push_back(load.vector);
      load.vector = -1;
    }
  }

  // ---- operations ----
  void operation(std::size_t i) {
    const MicroOp& op = stage_.ops[i];
    emit(op, temps_[i]);
    for (const MicroArg& arg : op.args) used(arg);
    free_.insert(free_.end(), loose_.begin(), loose_.end());
    free_masks_.insert(free_masks_.end(), loose_masks_.begin(), loose_masks_.end());
    loose_.clear();
    loose_masks_.clear();
    pinned_.clear();
    pinned_masks_.clear();
  }

  Zmm result(Value& y) {
    const Zmm v = new_vector();
    y.vector = v.getIdx();
    pinned_.push_back(y.vector);
    return v;
  }

  Zmm loose() {
    const Zmm v = new_vector();
    loose_.push_back(v.getIdx());
    pinned_.push_back(v.getIdx());
    return v;
  }

  template <class Emit>
  void binary(const MicroOp& op, Value& y, const Emit& instruction) {
    MicroArg first = op.args[0], second = op.args[1];
    const bool commutes = op.op == Opcode::kAdd || op.op == Opcode::kMul;
    // The second operand may lie in memory.
    if (commutes && second.kind != MicroArg::Kind::kStream && first.kind == MicroArg::Kind::kStream)
      std::swap(first, second);
    const Zmm a = vector(first);
    const Zmm to = result(y);
    with_operand(second, [&](const auto& b) { instruction(to, a, b); });
  }

  void compare(const MicroOp& op, Value& y, Compare predicate) {
    const Zmm a = vector(op.args[0]);
    y.mask = new_mask();
    with_operand(op.args[1], [&](const auto& b) { vcmpps(Opmask(y.mask), a, b, predicate); });
  }

  template <class Emit>
  void logic(const MicroOp& op, Value& y, bool invert, const Emit& instruction) {
    const int a = truth(op.args[0]), b = truth(op.args[1]);
    y.mask = new_mask();
    instruction(Opmask(y.mask), Opmask(a), Opmask(b));
    if (invert) knotw(Opmask(y.mask), Opmask(y.mask));
  }

  void emit(const MicroOp& op, Value& y) {
    switch (op.op) {
      case Opcode::kCopy:
        return emit_copy(op, y);
      case Opcode::kAdd:
        return binary(op, y, [&](auto to, auto a, const auto& b) { vaddps(to, a, b); });
      case Opcode::kSub:
        return binary(op, y, [&](auto to, auto a, const auto& b) { vsubps(to, a, b); });
      case Opcode::kMul:
        return binary(op, y, [&](auto to, auto a, const auto& b) { vmulps(to, a, b); });
      case Opcode::kDiv:
        return binary(op, y, [&](auto to, auto a, const auto& b) { vdivps(to, a, b); });
      case Opcode::kMin:
        return binary(op, y, [&](auto to, auto a, const auto& b) { vminps(to, a, b); });
      case Opcode::kMax:
        return binary(op, y, [&](auto to, auto a, const auto& b) { vmaxps(to, a, b); });
      case Opcode::kLt:
        return compare(op, y, kLess);
      case Opcode::kLe:
        return compare(op, y, kLessEqual);
      case Opcode::kGt:
        return compare(op, y, kGreater);
      case Opcode::kGe:
        return compare(op, y, kGreaterEqual);
      case Opcode::kEq:
        return compare(op, y, kEqual);
      case Opcode::kNe:
        return compare(op, y, kNotEqual);
      case Opcode::kAnd:
        return logic(op, y, false, [&](auto to, auto a, auto b) { kandw(to, a, b); });
      case Opcode::kOr:
        return logic(op, y, false, [&](auto to, auto a, auto b) { korw(to, a, b); });
      case Opcode::kXor:
        return logic(op, y, false, [&](auto to, auto a, auto b) { kxorw(to, a, b); });
      case Opcode::kNand:
        return logic(op, y, true, [&](auto to, auto a, auto b) { kandw(to, a, b); });
      case Opcode::kNor:
        return logic(op, y, true, [&](auto to, auto a, auto b) { korw(to, a, b); });
      default:
        return emit_more(op, y);
    }
  }

  void emit_copy(const MicroOp& op, Value& y) {
    const Zmm to = result(y);
    with_operand(op.args[0], [&](const auto& a) { move(to, a); });
  }
  void move(const Zmm& to, const Zmm& a) { vmovaps(to, a); }
  void move(const Zmm& to, const Address& a) {
    if (a.isBroadcast())
      vpxord(to, zero(), a);
    else
      vmovups(to, a);
  }

  void emit_more(const MicroOp& op, Value& y) {
    switch (op.op) {
      case Opcode::kNot: {
        const int a = truth(op.args[0]);
        y.mask = new_mask();
        knotw(Opmask(y.mask), Opmask(a));
        return;
      }
      case Opcode::kSelect:
        return emit_select(op, y);
      case Opcode::kMac: {
        const Zmm a = vector(op.args[0]);
        const Zmm to = result(y);
        with_operand(op.args[1], [&](const auto& b) { vmulps(to, a, b); });
        with_operand(op.args[2], [&](const auto& c) { vaddps(to, to, c); });
        return;
      }
      case Opcode::kClamp: {
        const Zmm high = vector(op.args[2]), low = vector(op.args[1]);
        const Zmm to = result(y);
        with_operand(op.args[0], [&](const auto& a) { vminps(to, high, a); });
        vmaxps(to, low, to);
        return;
      }
      case Opcode::kMod: {
        const Zmm a = vector(op.args[0]), b = vector(op.args[1]);
        const Zmm to = result(y);
        vdivps(to, a, b);
        vrndscaleps(to, to, 9);
        vmulps(to, b, to);
        vsubps(to, a, to);
        return;
      }
      default:
        return emit_unary(op, y);
    }
  }

  // The mask's value with memory as the second source; a scalar mask is a vector like any other.
  void emit_select(const MicroOp& op, Value& y) {
    const int k = truth(op.args[0]);
    const Zmm no = vector(op.args[2]);
    const Zmm to = result(y);
    with_operand(op.args[1], [&](const auto& yes) { vblendmps(to | Opmask(k), no, yes); });
  }

  void emit_unary(const MicroOp& op, Value& y) {
    const Zmm a = vector(op.args[0]);
    const Zmm to = result(y);
    switch (op.op) {
      case Opcode::kAbs:
        vpandd(to, a, constant(0x7FFFFFFFU));
        return;
      case Opcode::kNeg:
        vpxord(to, a, constant(0x80000000U));
        return;
      case Opcode::kSqrt:
        vsqrtps(to, a);
        return;
      case Opcode::kFloor:
        vrndscaleps(to, a, 9);
        return;
      case Opcode::kCeil:
        vrndscaleps(to, a, 10);
        return;
      case Opcode::kSign: {
        const Opmask k(new_mask());
        loose_masks_.push_back(k.getIdx());
        const Zmm below = loose();
        vcmpps(k, a, zero(), kGreater);
        vmovaps(to | k | T_z, one());
        vcmpps(k, a, zero(), kLess);
        vmovaps(below | k | T_z, one());
        vsubps(to, to, below);
        return;
      }
      default:
        throw DoesNotFit{};
    }
  }

  const Stage& stage_;
  const std::uint32_t unroll_;  // vectors that one turn of the inner loop makes
  int ahead_ = 0;               // bytes from the column register to the vector at hand
  std::vector<Value> temps_;
  std::map<StreamKey, Value> loads_;
  std::map<std::uint32_t, Rolling> rolling_;  // by stream
  std::map<std::uint32_t, Value> scalars_, constants_;
  std::vector<int> free_, free_masks_;
  std::vector<int> pinned_, pinned_masks_;  // by the operation at hand
  std::vector<int> loose_, loose_masks_;    // that it frees
};

bool cpu_fits() {
  static const bool kFits = [] {
    const Xbyak::util::Cpu cpu;
    return cpu.has(Xbyak::util::Cpu::tAVX512F) && cpu.has(Xbyak::util::Cpu::tAVX512DQ);
  }();
  return kFits;
}

}  // namespace

std::unique_ptr<StageJit> StageJit::make(const Stage& stage, std::uint32_t vectors) {
  if (!cpu_fits()) return nullptr;
  for (const MicroOp& op : stage.ops)
    if (!joins_stages(op.op)) return nullptr;
  try {
    return std::make_unique<Compiler>(stage, vectors);
  } catch (const DoesNotFit&) {
    return nullptr;
  } catch (const Xbyak::Error&) {
    return nullptr;  // no memory that may be executed
  }
}

}  // namespace apron::vm

#else

namespace apron::vm {

std::unique_ptr<StageJit> StageJit::make(const Stage&, std::uint32_t) { return nullptr; }

}  // namespace apron::vm

#endif
