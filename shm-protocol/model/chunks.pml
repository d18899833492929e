/* A large actuator frame in two chunks: the controller announces its progress, the surface copies committed chunks and
 * hands them out before the frame is complete. Two controllers in succession, each killed at any step or not at all; an
 * answer may be refused, because the surface abandoned the sensor frame, after its chunks have been copied.
 *
 * Every attempt to answer writes a unique number into both chunks, so that a mixture is detected.
 * Variants that must fail: NO_RESET, NO_LABEL, REUSE_NUMBER, EARLY_PROGRESS, HANDED_UNCHECKED, HALF_IS_WHOLE.
 */
#define kSlots 2
#define kControllers 2
#define kAttempts 2
#define AT(frame, chunk) (((frame) % kSlots) * 2 + (chunk))

byte data[8];                    /* [AT(frame, chunk)] */
byte word, attached;
byte ready_frame, ready_chunks;  /* one word: line 10 */

/* For the properties only. */
bool killed[3];
byte attempts_made, over, published, accepted;
byte whole[8]; /* [frame] the attempt that was published as this frame */

inline say_ready(n) { d_step { ready_frame = n; ready_chunks = 1 } }

proctype controller(byte me) {
  byte frame, attempt, made;
  {
    (over == me - 1);
#ifndef NO_RESET
    d_step { ready_frame = 0; ready_chunks = 0 };
#endif
    frame = word;
    attached++;
    do
    :: made == kAttempts -> break
    :: made < kAttempts && published == accepted -> /* lock-step: the previous answer was taken */
       d_step { made++; attempts_made++; attempt = attempts_made };
#ifdef EARLY_PROGRESS
       say_ready(frame + 1);
#endif
       data[AT(frame + 1, 0)] = attempt;
#ifndef EARLY_PROGRESS
       say_ready(frame + 1);
#endif
#ifdef HALF_IS_WHOLE
       d_step { whole[frame + 1] = attempt; word = frame + 1; published++ };
       data[AT(frame + 1, 1)] = attempt;
       frame++
#else
       data[AT(frame + 1, 1)] = attempt;
       if
       :: d_step { whole[frame + 1] = attempt; word = frame + 1; published++ }; frame++
       :: /* refused */
#ifdef REUSE_NUMBER
          skip
#else
          frame++ /* its number is not reused */
#endif
       fi
#endif
    od
  } unless { killed[me] };
  over++
}

#ifdef NO_LABEL
#define WHO 0
#else
#define WHO attached
#endif

proctype surface() {
  byte taken, newest, who, coming, ready;
  byte copy_frame, copy_who, copied, first, second; /* chunks copied early, and their frame and controller */
  byte given, given_frame, given_who;               /* the chunk handed out, 0: none */
  do
  :: newest = word;
     if
     :: newest == taken ->
        who = WHO; /* before the progress line */
        d_step { coming = ready_frame; ready = ready_chunks };
        if
        :: ready != 0 && coming == newest + 1 ->
           d_step {
             if
             :: copy_frame != coming || copy_who != who -> copy_frame = coming; copy_who = who; copied = 0
             :: else
             fi
           };
           if
           :: copied == 0 -> first = data[AT(coming, 0)]; copied = 1
           :: else
           fi;
           if
           :: given == 0 -> d_step { given = first; given_frame = coming; given_who = who }
           :: skip
           fi
        :: else -> if :: over == kControllers && word == taken -> break :: else fi
        fi
     :: else ->
        who = WHO;
        if
#ifndef HANDED_UNCHECKED
        :: given != 0 && (given_frame != newest || given_who != who) -> given = 0 /* reported as torn */
#endif
        :: else ->
           if
           :: copied == 1 && copy_frame == newest && copy_who == who
           :: else -> first = data[AT(newest, 0)]
           fi;
           second = data[AT(newest, 1)];
           assert(word == newest);
           assert(first == whole[newest] && second == whole[newest]); /* complete frames only */
           assert(given == 0 || given == whole[newest]);              /* the chunk handed out is of that frame */
           d_step { taken = newest; given = 0; copied = 0; copy_frame = 0; copy_who = 0; accepted++ }
        fi
     fi
  od
}

proctype killer() {
end:
  do
  :: atomic { !killed[1] -> killed[1] = true }
  :: atomic { !killed[2] -> killed[2] = true }
  :: break
  od
}

init { atomic { run surface(); run controller(1); run controller(2); run killer() } }
