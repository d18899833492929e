/* One surface and one controller in time-step mode: frames in slots, the two words, the two waiting flags and the
 * futex. Frame counts wrap at kWrap, so that the run is endless and the state space finite, as the 32-bit words do.
 *
 * A sleep has no time-out here, so that a lost wake-up is a deadlock. -DSLICES adds the 50 ms slices.
 * A store that the protocol calls sequentially consistent is in memory before the next step; flag = 0 is relaxed and
 * may reach memory at any later time (process memory).
 *
 * Variants that must fail: FLAG_LATE, CHECK_FIRST, NO_COMPARE, WEAK_PUBLISHER, WEAK_SLEEPER, EARLY_WORD, RUN_AHEAD,
 * ANSWER_TWICE, and CLOSING without SLICES. README.md lists what each breaks.
 */
#define kWrap 8
#define kSlots 2
#define next(n) (((n) + 1) % kWrap)

#define SURFACE 0
#define CONTROLLER 1

/* Index 0: the sensor ring, written by the surface; 1: the actuator ring. Two halves stand for an array. */
byte first_half[8], second_half[8]; /* [side * kSlots + frame % kSlots] */
byte word[2];
byte answers;       /* on the actuators' publication line */
bool flag[2];       /* [side]: that side may sleep on the other side's word */
bool asleep[2];
bool closing;       /* the surface's state */

/* Stores not yet in memory: at most one per word; the next store to the same word waits for it. */
bool flag_pending[2], flag_value[2];
bool word_pending[2];
byte word_value[2];

/* For the properties only. */
byte published, answered; /* newest sensor frame published, newest one answered */
bool controller_done;

proctype memory() {
end:
  do
  :: d_step { flag_pending[0] -> flag[0] = flag_value[0]; flag_pending[0] = false }
  :: d_step { flag_pending[1] -> flag[1] = flag_value[1]; flag_pending[1] = false }
  :: d_step { word_pending[0] -> word[0] = word_value[0]; word_pending[0] = false }
  :: d_step { word_pending[1] -> word[1] = word_value[1]; word_pending[1] = false }
  od
}

inline store_flag_relaxed(me, value) {
  d_step { !flag_pending[me] -> flag_value[me] = value; flag_pending[me] = true }
}
inline store_flag(me, value) {
#ifdef WEAK_SLEEPER
  store_flag_relaxed(me, value)
#else
  d_step { !flag_pending[me] -> flag[me] = value }
#endif
}
inline store_word(me, value) {
#ifdef WEAK_PUBLISHER
  d_step { !word_pending[me] -> word_value[me] = value; word_pending[me] = true }
#else
  word[me] = value
#endif
}

inline wake(whom) { asleep[whom] = false }

/* The kernel compares and sleeps in one step. */
inline futex_wait(me, seen) {
#ifdef NO_COMPARE
  asleep[me] = true;
#else
  d_step { if :: word[1 - me] == seen -> asleep[me] = true :: else fi };
#endif
  if
  :: !asleep[me]
#ifdef SLICES
  :: asleep[me] -> asleep[me] = false /* the slice ended */
#endif
  fi
}

/* Publishes the slot. */
inline ring(me, value) {
  store_word(me, value);
  if
  :: flag[1 - me] -> wake(1 - me)
  :: else
  fi
}

/* The fill of a slot and the publication line, then the word. */
inline publish(me, frame, reply) {
#ifdef EARLY_WORD
  if :: me == CONTROLLER -> answers = reply :: else fi;
  ring(me, frame);
#endif
  first_half[me * kSlots + frame % kSlots] = (me == SURFACE -> frame : reply);
  second_half[me * kSlots + frame % kSlots] = (me == SURFACE -> frame : reply);
#ifndef EARLY_WORD
  if :: me == CONTROLLER -> answers = reply :: else fi;
  ring(me, frame)
#endif
}

/* One round of the slow path; the caller has checked once. ready: an expression without side effects. */
inline sleep_unless(me, ready, seen) {
#ifdef FLAG_LATE
  if
  :: ready
  :: else -> store_flag(me, true); seen = word[1 - me]; futex_wait(me, seen)
  fi;
#else
  store_flag(me, true);
#ifdef CHECK_FIRST
  if
  :: ready
  :: else -> seen = word[1 - me]; futex_wait(me, seen)
  fi;
#else
  seen = word[1 - me];
  if
  :: ready
  :: else -> futex_wait(me, seen)
  fi;
#endif
#endif
  seen = 0;
  store_flag_relaxed(me, false)
}

#define ANSWER_IS_THERE (word[CONTROLLER] != taken && answers == frame)

proctype surface() {
  byte frame = 0, taken = 0, seen;
  do
  :: frame = next(frame);
     assert(answered == published); /* the surface never runs ahead */
     d_step { published = frame }
     publish(SURFACE, frame, 0);
#ifdef RUN_AHEAD
     if :: goto unanswered :: skip fi;
#endif
     do
     :: ANSWER_IS_THERE -> break
     :: else -> sleep_unless(SURFACE, ANSWER_IS_THERE, seen)
     od;
     taken = word[CONTROLLER];
     assert(first_half[kSlots + taken % kSlots] == frame);
     assert(second_half[kSlots + taken % kSlots] == frame);
     assert(word[CONTROLLER] == taken);
progress_tick:
#ifdef CLOSING
     if :: break :: skip fi;
#endif
#ifdef RUN_AHEAD
unanswered:
#endif
     skip
  od;
#ifdef CLOSING
  closing = true;
  wake(CONTROLLER)
#endif
}

#define FRAME_IS_NEW (word[SURFACE] != taken)

proctype controller() {
  byte frame = 0, taken = 0, seen;
  do
  :: do
     :: FRAME_IS_NEW -> break
     :: else ->
        if
        :: closing -> goto done
        :: else
        fi;
        sleep_unless(CONTROLLER, FRAME_IS_NEW, seen)
     od;
     taken = word[SURFACE];
     assert(taken == next(answered)); /* each frame once, in order */
     assert(first_half[taken % kSlots] == taken);
     assert(second_half[taken % kSlots] == taken);
     assert(word[SURFACE] == taken); /* not overwritten while it was read in place */
     d_step { answered = taken };
     frame = next(frame);
     publish(CONTROLLER, frame, taken);
#ifdef ANSWER_TWICE
     if :: taken = (taken + kWrap - 1) % kWrap :: skip fi
#endif
  od;
done:
  controller_done = true
}

init { atomic { run memory(); run surface(); run controller() } }

#ifdef CLOSING
ltl closing_ends_the_wait { [] (closing -> <> controller_done) }
#endif
