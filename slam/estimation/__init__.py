"""What an estimator offers, and the models of motion and measurement that all of them share."""
