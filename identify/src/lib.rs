//! Closing the loop: what a real flight shows that the declared model lacks.
