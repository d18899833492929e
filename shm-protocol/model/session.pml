/* Attach, death, takeover and return: two lives of the surface under one name and three of controllers, each killed
 * at any step or not at all; each controller may detach at any frame.
 *
 * A process word identifies one life forever, so a life is a number and DEAD(life) is the answer of /proc. Sleeps last
 * a slice at most (handshake.pml models them fully), so waiting is polling. Each step is one load, one store or one
 * atomic exchange of the protocol; anything in between is private.
 *
 * Variants that must fail: LINE_UNCHECKED, TRUST_LINE, FORGET_PREDECESSOR, PID_ONLY, STORE_CLAIM, NO_LIVENESS,
 * LEAVING_UNSEEN.
 */
#ifndef kSurfaces
#define kSurfaces 1
#endif
#ifndef kControllers
#define kControllers 2
#endif
#ifndef kFrames
#define kFrames 2
#endif
#ifndef kKills
#define kKills 1
#endif
#define kSlots 2

/* Controllers are 1 … kControllers, surfaces 1 … kSurfaces; 0 is none. */
bool killed_controller[4], killed_surface[3];
bool ended[4]; /* controllers */
byte kills;

#ifdef PID_ONLY
#define DEAD(life) (false) /* another process has the pid */
#else
#define DEAD(life) (killed_controller[life])
#endif

/* What /dev/shm/smartsurf.NAME is: the segment of this surface. The file stays when its surface is killed. */
byte name;

/* One segment for each surface: [surface]. */
byte claim[3], detached[3];
bool says_closing[3]; /* the controller's state */
bool closing[3];
byte sensor_word[3];
byte actuator_word[3], line_frame[3], line_answers[3];

/* The actuator slots, [surface * kSlots + frame % kSlots]. */
#define SLOT(s, frame) ((s) * kSlots + (frame) % kSlots)
bool slot_open[12];
byte slot_frame[12], slot_answers[12], slot_value[12];

/* For the properties only. */
byte answers_given[12];  /* [surface * 4 + sensor frame]: how often its answer was published */
byte taken_in[12];       /* how often the surface took an answer to it */
byte surfaces_over, controllers_over;

inline open_slot(s, frame) {
  d_step { slot_open[SLOT(s, frame)] = true; slot_frame[SLOT(s, frame)] = frame }
}

/* ---- the surface ---------------------------------------------------------------------------------------------- */
#define ALL_IS_WELL 0
#define NO_CONTROLLER 1
#define CONTROLLER_DIED 2
#define CONTROLLER_LEFT 3

/* Tracks its controller: adopts one, or reports once that the known one is lost. */
inline look_at_controller() {
  status = ALL_IS_WELL;
  if
  :: known == 0 ->
     do
     :: departures = detached[me];
        known = claim[me];
#ifndef LEAVING_UNSEEN
        leaving = says_closing[me];
#endif
        if
        :: claim[me] == known -> if :: detached[me] == departures -> break :: else fi
        :: else
        fi
     od
  :: else
  fi;
  if
  :: d_step { known == 0 -> status = NO_CONTROLLER; departures = 0; leaving = false }
  :: else ->
     if
     :: claim[me] != known ->
        status = (leaving || detached[me] != departures -> CONTROLLER_LEFT : CONTROLLER_DIED);
        assert(status == CONTROLLER_LEFT || killed_controller[known]); /* only killed controllers are reported dead */
        d_step { known = 0; departures = 0; leaving = false }
#ifndef NO_LIVENESS
     :: claim[me] == known && DEAD(known) ->
#ifdef STORE_CLAIM
        claim[me] = 0;
#else
        d_step { if :: claim[me] == known -> claim[me] = 0 :: else fi };
#endif
        status = CONTROLLER_DIED;
        d_step { known = 0; departures = 0; leaving = false }
#endif
     :: else
     fi
  fi
}

#define ANSWER_IS_THERE (actuator_word[me] != taken && line_answers[me] == frame)
#define NOBODY_WILL_COME (controllers_over == kControllers)

proctype surface(byte me) {
  byte frame, taken, known, departures, status;
  bool settled = true, leaving;
  {
    /* A living owner refuses; a dead one's segment is reclaimed (names.pml). Here the second starts after the first. */
    (me == 1 || surfaces_over == me - 1);
    name = me;
    do
    :: frame == kFrames -> break
    :: else ->
       assert(settled);
       d_step { settled = false; frame++ };
       sensor_word[me] = frame;
       do
       :: ANSWER_IS_THERE ->
          taken = actuator_word[me];
          if
#ifndef LINE_UNCHECKED
          :: line_frame[me] != taken /* the line is already the next frame's: torn; retry */
#endif
          :: else ->
             assert(slot_value[SLOT(me, taken)] == frame);
             assert(actuator_word[me] == taken);
             d_step { settled = true; taken_in[me * 4 + frame]++; assert(taken_in[me * 4 + frame] == 1) };
             break
          fi
       :: else ->
          look_at_controller();
          if
          :: status == ALL_IS_WELL
          :: status != ALL_IS_WELL && !NOBODY_WILL_COME -> status = 0 /* and waits for the next one */
          :: d_step { status != ALL_IS_WELL -> settled = true; status = 0 }; break /* continues without one */
          fi
       od
    od;
    closing[me] = true;
    name = 0
  } unless { killed_surface[me] };
  d_step { surfaces_over++ }
}

/* ---- the controller ------------------------------------------------------------------------------------------- */
inline attach() {
  do
  :: d_step { name != 0 -> to = name };
     if
     :: killed_surface[to] || closing[to]
     :: else ->
        holder = claim[to];
        if
        :: holder != 0 && !DEAD(holder) /* refused; it retries */
        :: else ->
           /* one compare-and-swap */
           d_step {
             done = (claim[to] == holder);
             if
             :: done -> assert(claim[to] == 0 || killed_controller[claim[to]]); claim[to] = me
             :: else
             fi;
             holder = 0
           };
           if :: done -> break :: else fi
        fi
     fi
  :: surfaces_over == kSurfaces -> goto over
  od;
  done = false
}

/* Resumes where the predecessor stopped, as its last complete slot says. */
inline take_over() {
  says_closing[to] = false;
  frame = actuator_word[to];
#ifdef FORGET_PREDECESSOR
  answered = 0;
#else
#ifdef TRUST_LINE
  answered = line_answers[to];
#else
  d_step {
    if
    :: frame != 0 && !slot_open[SLOT(to, frame)] && slot_frame[SLOT(to, frame)] == frame ->
       answered = slot_answers[SLOT(to, frame)]
    :: else -> answered = 0
    fi
  };
#endif
#endif
  open_slot(to, frame + 1)
}

inline publish_answer() {
  d_step { frame++; slot_value[SLOT(to, frame)] = seen; slot_answers[SLOT(to, frame)] = seen };
  d_step { slot_frame[SLOT(to, frame)] = frame; slot_open[SLOT(to, frame)] = false };
  line_frame[to] = frame;
  line_answers[to] = seen;
  d_step {
    actuator_word[to] = frame;
    answers_given[to * 4 + seen]++;
    assert(answers_given[to * 4 + seen] == 1); /* no successor answers again */
    assert(claim[to] == me)                    /* only the claim's holder publishes */
  };
  answered = seen;
  open_slot(to, frame + 1)
}

inline detach() {
  says_closing[to] = true;
  detached[to]++;
  d_step { if :: claim[to] == me -> claim[to] = 0 :: else fi }
}

#define FRAME_IS_NEW (sensor_word[to] != seen && sensor_word[to] != answered)
#define SURFACE_IS_GONE (closing[to] || killed_surface[to])

proctype controller(byte me) {
  byte to, holder, frame, seen, answered;
  bool done;
  {
    do
    :: attach();
       take_over();
       do
       :: FRAME_IS_NEW ->
          seen = sensor_word[to];
          /* The surface may have continued, if it did not know of this controller when it published. */
          if
          :: sensor_word[to] == seen -> publish_answer()
          :: else
          fi
       :: !FRAME_IS_NEW && SURFACE_IS_GONE -> break
       :: !FRAME_IS_NEW && !SURFACE_IS_GONE /* waits on */
       :: !FRAME_IS_NEW && !SURFACE_IS_GONE -> detach(); goto over /* it detaches */
       od;
       detach(); /* then it waits for a new surface of that name */
       d_step { to = 0; frame = 0; seen = 0; answered = 0 }
    od;
over:
    skip
  } unless { killed_controller[me] };
  d_step { ended[me] = true; controllers_over++ }
}

/* Kills processes at any step, or stops. */
proctype killer() {
end:
  do
  :: atomic { kills < kKills && !ended[1] && !killed_controller[1] -> killed_controller[1] = true; kills++ }
#if kControllers > 1
  :: atomic { kills < kKills && !ended[2] && !killed_controller[2] -> killed_controller[2] = true; kills++ }
#endif
#if kSurfaces > 1
  :: atomic { kills < kKills && name == 1 && !killed_surface[1] -> killed_surface[1] = true; kills++ }
#endif
  :: kills = kKills; break
  od
}

init {
  atomic {
    run surface(1);
#if kSurfaces > 1
    run surface(2);
#endif
    run controller(1);
#if kControllers > 1
    run controller(2);
#endif
#if kControllers > 2
    run controller(3);
#endif
    run killer()
  }
}

ltl every_wait_ends { <> (surfaces_over == kSurfaces && controllers_over == kControllers) }
