/* The ring's four hand-overs on a machine with weak memory, each as a litmus test: one writer and one reader, a few steps, all
 * that C++'s memory model allows without loads from the future.
 *
 * Every location keeps all values that were ever stored, in the order of its stores. A thread's view is the oldest value
 * of each location that it may still read: a load takes any value from there on, so that loads overtake loads, and
 * stores to different locations become visible in any order. A release store, or a store behind a release fence,
 * carries its thread's view; an acquire load, or an acquire fence after a load, takes it over. A sequentially consistent load
 * takes no value older than the last sequentially consistent store of its location. Every location has one writer.
 *
 * Tests: RING, WORD, LINE, SLEEP. Variants that must fail, each one order of PROTOCOL.md weakened to relaxed:
 * RING with NO_OPEN_FENCE, RELAXED_COMMIT, RELAXED_FIRST_LOOK, NO_LOOK_FENCE; WORD with RELAXED_STORE, RELAXED_LOAD;
 * LINE with RELAXED_STORE, RELAXED_LOAD; SLEEP with WEAK_WRITER, WEAK_READER.
 */
#define kLocations 3
#define kValues 5 /* of one location, the initial 0 included */
#define kThreads 2

#define RELAXED 0
#define ORDERED 1 /* release for a store, acquire for a load */
#define SEQ_CST 2

byte stores[kLocations] = 1;
byte value_of[15];  /* [location * kValues + store] */
byte view_of[45];   /* [(location * kValues + store) * kLocations + location]: the view that it carries */
byte view[6];       /* [thread * kLocations + location] */
byte seen[6];       /* views of all values loaded: an acquire fence takes them over */
byte released[6];   /* the view at the last release fence */
byte last_sc[kLocations];

#define MESSAGE(at, n) (((at) * kValues + (n)) * kLocations)

inline raise_to(a, b) {
  if :: (a) < (b) -> a = b :: else fi
}

inline store(me, at, value, order) {
  d_step {
    n = stores[at];
    stores[at]++;
    value_of[at * kValues + n] = value;
    view[me * kLocations + at] = n;
    for (i : 0 .. kLocations - 1) {
      view_of[MESSAGE(at, n) + i] = (order == RELAXED -> released[me * kLocations + i] : view[me * kLocations + i])
    }
    view_of[MESSAGE(at, n) + at] = n;
    if :: order == SEQ_CST -> last_sc[at] = n :: else fi
  }
}

inline load(me, at, result, order) {
  atomic {
    n = view[me * kLocations + at];
    if :: order == SEQ_CST && last_sc[at] > n -> n = last_sc[at] :: else fi;
    do
    :: n < stores[at] - 1 -> n++
    :: break
    od;
    view[me * kLocations + at] = n;
    for (i : 0 .. kLocations - 1) {
      raise_to(seen[me * kLocations + i], view_of[MESSAGE(at, n) + i]);
      if
      :: order != RELAXED -> raise_to(view[me * kLocations + i], view_of[MESSAGE(at, n) + i])
      :: else
      fi
    }
    result = value_of[at * kValues + n]
  }
}

inline release_fence(me) {
  d_step { for (i : 0 .. kLocations - 1) { released[me * kLocations + i] = view[me * kLocations + i] } }
}

inline acquire_fence(me) {
  d_step { for (i : 0 .. kLocations - 1) { raise_to(view[me * kLocations + i], seen[me * kLocations + i]) } }
}

#define WRITER 0
#define READER 1

#ifdef RING
/* A slot that is written twice, with frames 1 and 2, and read without lock-step. Two halves stand for the arrays. */
#define SEQUENCE 0
#define FIRST 1
#define SECOND 2

#ifdef RELAXED_COMMIT
#define kCommit RELAXED
#else
#define kCommit ORDERED
#endif
#ifdef RELAXED_FIRST_LOOK
#define kFirstLook RELAXED
#else
#define kFirstLook ORDERED
#endif

active proctype writer() {
  byte n, i, frame;
  for (frame : 1 .. 2) {
    store(WRITER, SEQUENCE, 2 * frame - 1, RELAXED);
#ifndef NO_OPEN_FENCE
    release_fence(WRITER);
#endif
    store(WRITER, FIRST, frame, RELAXED);
    store(WRITER, SECOND, frame, RELAXED);
    store(WRITER, SEQUENCE, 2 * frame, kCommit)
  }
}

active proctype reader() {
  byte n, i, before, after, first, second;
  load(READER, SEQUENCE, before, kFirstLook);
  load(READER, FIRST, first, RELAXED);
  load(READER, SECOND, second, RELAXED);
#ifndef NO_LOOK_FENCE
  acquire_fence(READER);
#endif
  load(READER, SEQUENCE, after, RELAXED);
  if
  :: before != 0 && before % 2 == 0 && before == after ->
     assert(first == before / 2 && second == before / 2) /* a whole frame, and the one that it is taken for */
  :: else
  fi
}
#endif

#ifdef RELAXED_STORE
#define kStore RELAXED
#else
#define kStore ORDERED
#endif
#ifdef RELAXED_LOAD
#define kLoad RELAXED
#else
#define kLoad ORDERED
#endif

#ifdef WORD
/* Two frames, or two chunks of one, behind one word: a reader that sees the word sees all of the frame. */
#define NUMBER 0
#define FIRST 1
#define SECOND 2

active proctype writer() {
  byte n, i, frame;
  for (frame : 1 .. 2) {
    if :: frame == 1 -> store(WRITER, FIRST, 1, RELAXED) :: else -> store(WRITER, SECOND, 2, RELAXED) fi;
    store(WRITER, NUMBER, frame, kStore)
  }
}

active proctype reader() {
  byte n, i, number, first, second;
  load(READER, NUMBER, number, kLoad);
  load(READER, FIRST, first, RELAXED);
  load(READER, SECOND, second, RELAXED);
  assert(number < 1 || first == 1);
  assert(number < 2 || second == 2)
}
#endif

#ifdef LINE
/* The publication line: a reader that sees the new `answers` sees the new `frame`. */
#define FRAME 0
#define ANSWERS 1

active proctype writer() {
  byte n, i, frame;
  for (frame : 1 .. 2) {
    store(WRITER, FRAME, frame, RELAXED);
    store(WRITER, ANSWERS, frame, kStore)
  }
}

active proctype reader() {
  byte n, i, answers, frame;
  load(READER, ANSWERS, answers, kLoad);
  load(READER, FRAME, frame, RELAXED);
  assert(frame >= answers)
}
#endif

#ifdef SLEEP
/* The publisher of a word and a reader that goes to sleep: one of them sees the other's store. */
#define NUMBER 0
#define FLAG 1
#ifdef WEAK_WRITER
#define kWriter ORDERED
#else
#define kWriter SEQ_CST
#endif
#ifdef WEAK_READER
#define kReader ORDERED
#else
#define kReader SEQ_CST
#endif
byte flag_seen, number_seen;
bool writer_done, reader_done;

active proctype writer() {
  byte n, i;
  store(WRITER, NUMBER, 1, kWriter);
  load(WRITER, FLAG, flag_seen, kWriter);
  writer_done = true;
  assert(!reader_done || flag_seen == 1 || number_seen == 1)
}

active proctype reader() {
  byte n, i;
  store(READER, FLAG, 1, kReader);
  load(READER, NUMBER, number_seen, kReader);
  reader_done = true;
  assert(!writer_done || flag_seen == 1 || number_seen == 1)
}
#endif
