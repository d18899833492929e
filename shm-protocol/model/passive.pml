/* Passive mode: a writer that never waits, and a reader that takes the newest complete frame, or reports "torn" after
 * three tries. Two halves stand for an array.
 *
 * Variants that must fail: NO_SECOND_LOOK, NO_FIRST_LOOK, and the orders that the fences forbid, written as the steps
 * that they would allow: OPEN_LATE (the array before the odd number), CLOSE_EARLY (even number and word before the
 * array), LOOK_EARLY (the second check before the array was read).
 */
#define kSlots 4
#define kFrames 9
#define SLOT(n) ((n) % kSlots)

byte sequence[kSlots], first_half[kSlots], second_half[kSlots];
byte word;
bool written;

proctype writer() {
  byte n = 1;
#ifndef OPEN_LATE
  sequence[SLOT(1)] = 1;
#endif
  do
  :: n > kFrames -> break
  :: else ->
     first_half[SLOT(n)] = n;
#ifdef OPEN_LATE
     sequence[SLOT(n)] = 2 * n - 1;
#endif
#ifdef CLOSE_EARLY
     sequence[SLOT(n)] = 2 * n;
     word = n;
     second_half[SLOT(n)] = n;
#else
     second_half[SLOT(n)] = n;
     sequence[SLOT(n)] = 2 * n;
     word = n;
#endif
     n++;
#ifndef OPEN_LATE
     sequence[SLOT(n)] = 2 * n - 1
#endif
  od;
  written = true
}

proctype reader() {
  byte last, newest, seen, again, a, b, tries, taken, skipped;
  do
  :: newest = word;
     if
     :: newest == last -> if :: written && word == last -> break :: else fi
     :: else ->
        seen = sequence[SLOT(newest)];
        if
#ifndef NO_FIRST_LOOK
        :: seen != 2 * newest -> tries++
#endif
        :: else ->
           a = first_half[SLOT(newest)];
#ifdef LOOK_EARLY
           again = sequence[SLOT(newest)];
           b = second_half[SLOT(newest)];
#else
           b = second_half[SLOT(newest)];
           again = sequence[SLOT(newest)];
#endif
           if
#ifndef NO_SECOND_LOOK
           :: again != seen -> tries++
#endif
           :: else ->
              assert(a == newest && b == newest); /* complete frames only */
              d_step { skipped = skipped + (newest - last - 1); taken++; last = newest; tries = 0 };
              assert(taken + skipped == last) /* every frame is taken or counted */
           fi
        fi;
        d_step { again = 0; seen = 0; a = 0; b = 0 };
        if
        :: tries == 3 -> tries = 0 /* torn: the previous frame stays */
        :: else
        fi
     fi
  od;
  assert(last == kFrames) /* the newest is reached once the writer stops */
}

init { atomic { run writer(); run reader() } }
