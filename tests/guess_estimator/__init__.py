"""An estimator of weak errors as one may be added: each error is guessed to be c h, without computing anything."""
