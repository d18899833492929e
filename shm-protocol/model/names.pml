/* The file name: starting surfaces, a cleaner and an ending surface compete for one name, under which a dead surface has
 * left its segment. Two surfaces (1, 2) and a cleaner (3); each may be killed at any step.
 *
 * A file is known by its inode, here the number of the surface that built it; kLeftOver is the dead one's.
 * Variants that must fail: NO_LOCK, NO_INODE_CHECK, NO_OWNER_CHECK, RENAME_REPLACES.
 */
#define kLeftOver 4
#define kNobody 0

byte name = kLeftOver; /* the file under the name; 0: none */
bool dead[5];          /* owners of files, and lives in general */
byte lock[5];          /* flock: [file] who holds it; the kernel releases it when the holder dies */
bool in_place[5];      /* a surface whose segment has the name, from the rename to its own removal */
bool refused[5];
byte finished;

/* Removes the named file if its owner is dead; does nothing in doubt. */
inline remove_if_orphan() {
  file = name; /* open */
  if
  :: file == 0
  :: else ->
#ifndef NO_LOCK
     atomic { lock[file] == kNobody || dead[lock[file]] -> lock[file] = me };
#endif
     if
#ifndef NO_INODE_CHECK
     :: name != file
#endif
     :: else ->
        if
#ifndef NO_OWNER_CHECK
        :: !dead[file]
#endif
        :: else -> unlink()
        fi
     fi;
#ifndef NO_LOCK
     lock[file] = kNobody;
#endif
     file = 0
  fi
}

/* unlink() takes a name, not a file: it removes the file that has the name by now. */
inline unlink() {
  d_step {
    assert(name == 0 || dead[name] || name == me); /* a living surface's segment is never removed */
    name = 0
  }
}

proctype surface(byte me) {
  byte file;
  bool renamed;
  {
    do
    :: file = name;
       if
       :: file != 0 && !dead[file] -> refused[me] = true; goto over
       :: file == 0
       :: else -> remove_if_orphan()
       fi;
       file = 0;
       d_step {
#ifdef RENAME_REPLACES
         renamed = true;
#else
         renamed = (name == 0);
#endif
         if
         :: renamed ->
            assert(name == 0 || dead[name]); /* at most one living surface has the name */
            name = me;
            in_place[me] = true
         :: else
         fi
       };
       if :: renamed -> break :: else fi
    od;
    assert(name == me); /* while it runs */
    atomic { lock[me] == kNobody || dead[lock[me]] -> lock[me] = me };
    if
    :: name == me -> in_place[me] = false; unlink()
    :: else -> assert(false)
    fi;
    lock[me] = kNobody;
over:
    skip
  } unless { dead[me] };
  finished++
}

proctype cleaner(byte me) {
  byte file;
  { remove_if_orphan() } unless { dead[me] };
  finished++
}

proctype killer() {
end:
  do
  :: atomic { !dead[1] -> dead[1] = true }
  :: atomic { !dead[2] -> dead[2] = true }
  :: atomic { !dead[3] -> dead[3] = true }
  :: break
  od
}

init { atomic { dead[kLeftOver] = true; run surface(1); run surface(2); run cleaner(3); run killer() } }

/* Whichever process is killed, none waits forever for a lock or a name. */
ltl every_start_ends { <> (finished == 3) }
