"""What a proposer is told about a trial: a number, structured features, or a picture as well."""
