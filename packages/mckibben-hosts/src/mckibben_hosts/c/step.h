
/* What the rates of the host's spans belong to: the time of the spans, or half a step earlier (semi-implicit Euler). */
enum { UPPER_SYNCHRONOUS = 0, UPPER_STAGGERED = 1 };

/* Numbers of which a state consists: it may be kept as an array of double. */
enum { UPPER_STATE_SIZE = (int)(sizeof(NAME_state) / sizeof(double)) };

/* Go on by one step of the host [s]: the mechanism is then stepped with the mean tensions of the outputs.
   A state of zeros rests at these spans and commands first. */
void NAME_step(const NAME_parameters *parameters, NAME_state *state, const NAME_inputs *inputs, double period,
               int staggered, NAME_outputs *outputs);

/* What a code of `sound` means: anything but 1 says why a step cannot be relied on. */
const char *NAME_meaning(double sound);
